"""Provenance: all that a stranger needs to run an evaluation again."""

from __future__ import annotations

import hashlib
import importlib
import json
import struct
import zipfile

import pytest
from run_folders import FEW, IMPORTS, summary_of

from mazebench import __version__
from mazebench.agent_loading import load_agent_class
from mazebench.evaluation import provenance
from mazebench.evaluation.eval_options import eval_options
from mazebench.evaluation.evaluate import evaluate
from mazebench.evaluation.plan import make_plan
from mazebench.evaluation.provenance import checkpoint_metadata, code_hash
from mazebench.maps.benchmark import manifest_hash


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
    found = make_plan(eval_options("mah", checkpoint=checkpoint)).provenance.model_dump()
    assert found["checkpoint_sha256"] == hashlib.sha256((tmp_path / "x.safetensors").read_bytes()).hexdigest()
    assert found["checkpoint_metadata"] == {"mine": {"config": {"width": 8}}}
    assert found["checkpoint"] == checkpoint
    # One that ships is told without the path to it.
    assert make_plan(eval_options("mah")).provenance.model_dump()["checkpoint"] == "mah-13.safetensors"


def test_an_agent_at_hand_is_named_by_all_modules_that_it_imports_from_its_folder(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "folder_at_hand").mkdir()
    agent = f"""{IMPORTS}import features_at_hand
class Mine(SingleAgent):
    @classmethod
    def build(cls, interface, **given):
        import folder_at_hand.late
        return cls()

    def act(self, observation):
        return 0
"""
    files = {"provenance_at_hand.py": agent, "features_at_hand.py": "", "folder_at_hand/late.py": "", "unused.py": ""}
    for name, code in files.items():
        (tmp_path / name).write_text(code)
    name = "provenance_at_hand:Mine"
    found = make_plan(eval_options(name)).provenance
    assert (found.agent_class, found.agent_package) == (name, None)
    monkeypatch.setattr(provenance, "_STANDARD", tmp_path / "lib")  # as of Python in a folder below the agent's
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib" / "standard_at_hand.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path / "lib")
    importlib.import_module("standard_at_hand")
    assert make_plan(eval_options(name)).provenance.agent_code_sha256 == found.agent_code_sha256
    for changed in files:
        (tmp_path / changed).write_text(files[changed] + "# changed")
        is_other = make_plan(eval_options(name)).provenance.agent_code_sha256 != found.agent_code_sha256
        assert is_other == (changed != "unused.py")
        (tmp_path / changed).write_text(files[changed])


def test_an_agent_in_an_archive_is_evaluated_and_has_no_hash(tmp_path, monkeypatch, remarks):
    code = f"{IMPORTS}class Mine(SingleAgent):\n    def act(self, observation):\n        return 0\n"
    with zipfile.ZipFile(tmp_path / "agents.zip", "w") as archive:
        archive.writestr("zipped_at_hand.py", code)
    monkeypatch.syspath_prepend(tmp_path / "agents.zip")
    summary = evaluate("zipped_at_hand:Mine", distances=(1,), episodes_per_distance=1)
    assert summary.provenance.agent_code_sha256 is None
    assert "zipped_at_hand:Mine: its code is in no file" in remarks()[0]


def test_an_installed_agent_is_named_by_all_python_files_of_its_package(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    hashes = []
    for name, answer in (("one_at_hand", 0), ("same_at_hand", 0), ("other_at_hand", 1)):
        (tmp_path / name).mkdir()
        code = f"{IMPORTS}from .deep import act\n\n\nclass Mine(SingleAgent):\n    act = act\n"
        (tmp_path / name / "__init__.py").write_text(code)
        (tmp_path / name / "deep.py").write_text(f"def act(self, observation):\n    return {answer}\n")
        hashes.append(code_hash("mine", load_agent_class(f"{name}:Mine")))
    assert hashes[0] == hashes[1] != hashes[2]


@pytest.mark.parametrize(
    "content", [b"", b"\x80\x04pickle", struct.pack("<Q", 2**60) + b"{}", struct.pack("<Q", 4) + b"null"]
)
def test_a_checkpoint_of_another_kind_tells_nothing(tmp_path, content):
    (tmp_path / "x").write_bytes(content)
    assert checkpoint_metadata(str(tmp_path / "x")) is None
