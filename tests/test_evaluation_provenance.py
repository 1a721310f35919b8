"""Provenance: all that a stranger needs to run an evaluation again."""

from __future__ import annotations

import hashlib
import json
import struct

import pytest
from run_folders import FEW, IMPORTS, summary_of

from mazebench import __version__
from mazebench.agent_loading import load_agent_class
from mazebench.evaluation.eval_options import eval_options
from mazebench.evaluation.evaluate import evaluate
from mazebench.evaluation.plan import make_plan
from mazebench.evaluation.provenance import checkpoint_metadata, code_hash
from mazebench.maps.benchmark import manifest_hash
from mazebench.tasks.task import Task


def write_checkpoint(path, metadata: object) -> str:
    """Writes a file that begins as safetensors do."""
    header = json.dumps({"__metadata__": metadata}).encode()
    path.write_bytes(struct.pack("<Q", len(header)) + header + b"weights")
    return str(path)


def test_versions_options_and_machine_are_in_the_summary(tmp_path):
    evaluate("planner", out=tmp_path, seed=3, **FEW)
    found = summary_of(tmp_path)["provenance"]
    assert set(found) == {
        *("checkpoint", "benchmark_manifest_sha256", "mazes_sha256", "checkpoint_sha256", "task_version"),
        *("checkpoint_metadata", "agent_class", "agent_package", "agent_code_sha256", "seed", "command", "python"),
        *("packages", "machine", "episodes_per_distance"),
    }
    assert found["benchmark_manifest_sha256"] == manifest_hash()
    assert len(found["mazes_sha256"]) == 64
    assert (found["checkpoint_sha256"], found["checkpoint_metadata"]) == (None, None)
    assert found["agent_class"].startswith("mazebench_agents.planner.")
    assert found["agent_package"] == f"mazebench-mujoco {__version__}"
    assert len(found["agent_code_sha256"]) == 64
    assert (found["episodes_per_distance"], found["seed"]) == (1, 3)
    assert found["packages"]["mazebench-mujoco"] == __version__
    assert {"mujoco", "dm-control", "numpy", "scipy", "gymnasium", "torch"} <= set(found["packages"])
    assert {"system", "release", "processor", "cores"} <= set(found["machine"])


def test_a_checkpoint_is_named_by_its_hash_and_tells_its_config(tmp_path):
    checkpoint = write_checkpoint(tmp_path / "x.safetensors", {"mine": json.dumps({"config": {"width": 8}})})
    options = eval_options("mah", checkpoint=checkpoint)
    found = make_plan(options).provenance.model_dump()
    assert found["checkpoint_sha256"] == hashlib.sha256((tmp_path / "x.safetensors").read_bytes()).hexdigest()
    assert found["checkpoint_metadata"] == {"mine": {"config": {"width": 8}}}
    assert found["checkpoint"] == checkpoint


def test_a_checkpoint_that_ships_is_told_without_the_path_to_it():
    agent_class = load_agent_class("mah")
    options = eval_options("mah", checkpoint=str(agent_class.default_checkpoint()))
    found = make_plan(options).provenance.model_dump()
    assert found["checkpoint"] == "mah-13.safetensors"


def test_an_agent_at_hand_is_named_by_the_hash_of_its_file(tmp_path, monkeypatch):
    code = f"{IMPORTS}class Mine(SingleAgent):\n    def act(self, observation):\n        return 0\n"
    (tmp_path / "provenance_at_hand.py").write_text(code)
    monkeypatch.syspath_prepend(tmp_path)
    name = "provenance_at_hand:Mine"
    options = eval_options(name)
    found = make_plan(options).provenance.model_dump()
    assert found["agent_code_sha256"] == hashlib.sha256(code.encode()).hexdigest()
    assert (found["agent_class"], found["agent_package"]) == (name, None)


def test_an_installed_agent_is_named_by_the_hash_of_all_python_files_of_its_package(tmp_path, monkeypatch):
    package = tmp_path / "packaged_at_hand"
    package.mkdir()
    (package / "__init__.py").write_text(
        f"{IMPORTS}from .deep import act\n\n\nclass Mine(SingleAgent):\n    act = act\n"
    )
    (package / "deep.py").write_text("def act(self, observation):\n    return 0\n")
    monkeypatch.syspath_prepend(tmp_path)
    agent_class = load_agent_class("packaged_at_hand:Mine")
    found = code_hash("mine", agent_class)
    expected = hashlib.sha256()
    for name in ("__init__.py", "deep.py"):
        content = (package / name).read_bytes()
        expected.update(f"{name} {len(content)}\n".encode() + content)
    assert found == expected.hexdigest()


@pytest.mark.parametrize(
    "content", [b"", b"\x80\x04pickle", struct.pack("<Q", 2**60) + b"{}", struct.pack("<Q", 4) + b"null"]
)
def test_a_checkpoint_of_another_kind_tells_nothing(tmp_path, content):
    (tmp_path / "x").write_bytes(content)
    assert checkpoint_metadata(str(tmp_path / "x")) is None


def test_a_summary_of_a_track_has_the_time_limit_of_its_farthest_goals(tmp_path):
    evaluate("random", out=tmp_path, task="adrift", split="dev", distances=(15,))
    task = Task.from_json(summary_of(tmp_path)["task"])
    records = [json.loads(line) for line in (tmp_path / "episodes.jsonl").read_text().splitlines()]
    assert task.longest_episode == max(record["steps"] for record in records) == 6 * 15 + 150
