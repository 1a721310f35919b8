"""Checkpoints: what is saved comes back; a damaged one or one of another agent is refused in one line."""

import math
import pathlib
import pickle
import tempfile

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from mazebench_agents.common.checkpoint import load_agent, load_checkpoint, save_checkpoint
from mazebench_agents.dqn import DQN
from mazebench_agents.mah import MAH

from mazebench.agent import Interface
from mazebench.errors import InputError

ROOT = pathlib.Path(__file__).parent.parent
CHECKPOINT = ROOT / "assets" / "checkpoints" / "dqn-13.safetensors"
INTERFACE = Interface("local", 13, 13)


def test_saved_checkpoint_comes_back(tmp_path):
    path = tmp_path / "agent.safetensors"
    tensors = {"a": torch.arange(6.0).reshape(2, 3), "b": torch.tensor(1.5)}
    save_checkpoint(path, tensors, {"agent": "mah", "config": {"x": 1}})
    loaded, metadata = load_checkpoint(path, "mah")
    assert metadata["config"] == {"x": 1}
    assert torch.equal(loaded["a"], tensors["a"])
    assert list(tmp_path.iterdir()) == [path]


def saved(tmp_path, **changes):
    path = tmp_path / "agent.safetensors"
    agent = MAH(MAH.default_config, 13)
    metadata = {"agent": "mah", "config": {}, "context_size": 13, **changes}
    save_checkpoint(path, agent.network.state_dict(), metadata)
    return path


def test_another_agents_checkpoint_is_refused(tmp_path):
    with pytest.raises(InputError, match="expected a checkpoint of agent 'dqn', found one of 'mah'"):
        DQN.build(INTERFACE, checkpoint=saved(tmp_path))


def test_checkpoint_of_another_network_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"size mismatch for body\.0\.weight"):
        MAH.build(INTERFACE, checkpoint=saved(tmp_path, config={"hidden": 32}))


@pytest.mark.parametrize("config", [{"colour": 1}, {"hidden": "many"}, [1]])
def test_checkpoint_with_a_wrong_config_is_refused(tmp_path, config):
    with pytest.raises(InputError):
        MAH.build(INTERFACE, checkpoint=saved(tmp_path, config=config))


@pytest.mark.parametrize(
    ("content", "found"),
    [
        (
            b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 1234\n",
            "a Git LFS pointer; run git lfs pull",
        ),
        (b"\n<html><body>Sign in</body></html>", "an HTML page; download the file itself"),
        (b"PK\3\4" + bytes(26) + b"archive/data.pkl", "a file of PyTorch; save its tensors as safetensors"),
        (pickle.dumps({}), "a pickle; save its tensors as safetensors"),
    ],
)
def test_what_is_no_checkpoint_is_named(tmp_path, content, found):
    (tmp_path / "agent.safetensors").write_bytes(content)
    with pytest.raises(InputError, match=f"found {found}"):
        MAH.build(INTERFACE, checkpoint=tmp_path / "agent.safetensors")


@pytest.mark.parametrize("size", [-3, 0, 10**9, "13", 13.0, True, None, math.nan, math.inf])
def test_a_context_of_no_mazes_size_is_refused(tmp_path, size):
    with pytest.raises(InputError, match="expected a context_size of 5 to 1024, found"):
        MAH.build(INTERFACE, checkpoint=saved(tmp_path, context_size=size))


@pytest.mark.parametrize(
    ("value", "dtype", "found"),
    [(math.nan, "float32", "nan or inf"), (-math.inf, "float16", "nan or inf"), (1e300, "float64", "nan or inf")]
    + [(1, dtype, f"torch.{dtype}") for dtype in ("int32", "int64", "uint8", "bool")],
)
def test_weights_that_are_no_finite_floats_are_refused(tmp_path, value, dtype, found):
    tensors, metadata = load_checkpoint(saved(tmp_path), "mah")
    name = min(tensors)
    tensors[name] = torch.full_like(tensors[name], value, dtype=getattr(torch, dtype))
    save_checkpoint(tmp_path / "agent.safetensors", tensors, metadata)
    with pytest.raises(InputError, match=f"in {name}, found {found}"):
        MAH.build(INTERFACE, checkpoint=tmp_path / "agent.safetensors")


def test_very_many_tensors_are_refused_before_they_are_read(tmp_path):
    save_checkpoint(tmp_path / "many", {f"x{number}": torch.zeros(0) for number in range(10_001)}, {"agent": "mah"})
    with pytest.raises(InputError, match="expected a checkpoint of at most 10,000 tensors, found 10,001"):
        MAH.build(INTERFACE, checkpoint=tmp_path / "many")


@given(st.data())
@settings(max_examples=200, deadline=None)
def test_a_checkpoint_cut_or_changed_anywhere_is_read_or_refused_in_one_line(data):
    content = bytearray(CHECKPOINT.read_bytes())
    for position in data.draw(st.lists(st.integers(0, 3000) | st.integers(0, len(content) - 1), max_size=3)):
        content[position] = data.draw(st.integers(0, 255))
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "agent.safetensors"
        path.write_bytes(content[: data.draw(st.integers(0, len(content)) | st.just(len(content)))])
        try:
            said = load_agent(path, "dqn", DQN.default_config)[2]
        except InputError as error:
            said = error
    assert str(said).isprintable()


def test_missing_checkpoint_is_refused(tmp_path):
    with pytest.raises(InputError, match="can't read the checkpoint"):
        MAH.build(INTERFACE, checkpoint=tmp_path / "none")


@pytest.mark.parametrize(  # an agent's checkpoint has its config beside it
    "path",
    [path.with_name(path.name.replace(".config.json", ".safetensors"))
     for path in sorted((ROOT / "assets" / "checkpoints").glob("*.config.json"))],
    ids=lambda path: path.stem,
)  # fmt: skip
def test_the_page_of_shipped_checkpoints_says_what_their_files_say(path):
    tensors, metadata = load_checkpoint(path, path.stem.rpartition("-")[0])
    parameters = sum(tensor.numel() for tensor in tensors.values())
    steps, updates = (metadata["provenance"][name] for name in ("env_steps", "updates"))
    row = f"| `{path.stem}` | {parameters:,} | {steps:,} | {updates:,} |"
    assert row in (ROOT / "docs" / "reproduce.md").read_text(encoding="utf-8")
