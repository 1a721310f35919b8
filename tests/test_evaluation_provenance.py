"""Provenance: all that a stranger needs to run an evaluation again."""

from __future__ import annotations

import hashlib
import json
import struct

import pytest

from mazebench import __version__
from mazebench.agent import load_agent_class
from mazebench.evaluation.options import EvalOptions
from mazebench.evaluation.provenance import checkpoint_metadata, provenance
from mazebench.maps.benchmark import manifest_hash


def write_checkpoint(path, metadata: object) -> str:
    """A file that begins as safetensors do."""
    header = json.dumps({"__metadata__": metadata}).encode()
    path.write_bytes(struct.pack("<Q", len(header)) + header + b"weights")
    return str(path)


def test_provenance_when_agent_is_installed(tmp_path):
    checkpoint = write_checkpoint(tmp_path / "x.safetensors", {"mine": json.dumps({"config": {"width": 8}})})
    options = EvalOptions("planner", seed=3, checkpoint=checkpoint)
    found = provenance(options, load_agent_class("planner"))
    assert found["benchmark"] == "v1"
    assert found["benchmark_manifest_sha256"] == manifest_hash()
    assert found["checkpoint_sha256"] == hashlib.sha256((tmp_path / "x.safetensors").read_bytes()).hexdigest()
    assert found["checkpoint_metadata"] == {"mine": {"config": {"width": 8}}}
    assert found["agent_class"] == "mazebench_agents.planner.planner:Planner"
    assert found["agent_package"] == f"mazebench-mujoco {__version__}"
    assert found["agent_code_sha256"] is None
    assert (found["seed"], found["options"]["agent"]) == (3, "planner")
    assert found["packages"]["mazebench-mujoco"] == __version__
    assert {"mujoco", "dm-control", "numpy", "scipy", "gymnasium", "torch"} <= set(found["packages"])
    assert found["machine"]["cores"] >= 1
    assert {"system", "release", "processor"} <= set(found["machine"])
    assert json.loads(json.dumps(found, allow_nan=False)) == json.loads(json.dumps(found))


def test_provenance_when_agent_is_at_hand(tmp_path, monkeypatch):
    code = "class Mine:\n    build = initial_state = act = print\n"
    (tmp_path / "provenance_at_hand.py").write_text(code)
    monkeypatch.syspath_prepend(tmp_path)
    name = "provenance_at_hand:Mine"
    found = provenance(EvalOptions(name), load_agent_class(name))
    assert found["agent_code_sha256"] == hashlib.sha256(code.encode()).hexdigest()
    assert (found["agent_class"], found["agent_package"]) == (name, None)
    assert found["checkpoint_sha256"] is None
    assert found["checkpoint_metadata"] is None


@pytest.mark.parametrize(
    "content",
    [
        *(b"", b"\x80\x04pickle", struct.pack("<Q", 2**60) + b"{}", struct.pack("<Q", 4) + b"null"),
        struct.pack("<Q", 100_000) + b"[" * 100_000,
        struct.pack("<Q", 2) + b"\xff\xfe",
    ],
)
def test_metadata_when_checkpoint_is_of_another_kind(tmp_path, content):
    (tmp_path / "x").write_bytes(content)
    assert checkpoint_metadata(str(tmp_path / "x")) is None


@pytest.mark.parametrize("metadata", [{"mine": "not JSON"}, {"mine": "NaN"}, {"mine": 7}, [], None])
def test_metadata_when_it_is_no_json(tmp_path, metadata):
    assert checkpoint_metadata(write_checkpoint(tmp_path / "x", metadata)) is None
