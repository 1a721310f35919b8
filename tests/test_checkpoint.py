"""Checkpoints: what is saved comes back; a damaged one or one of another agent is refused in one line."""

import pathlib
import pickle

import pytest
import torch
from mazebench_agents.common.checkpoint import load_checkpoint, save_checkpoint
from mazebench_agents.dqn import DQN
from mazebench_agents.mah import MAH

from mazebench.agent import Interface
from mazebench.errors import InputError

ROOT = pathlib.Path(__file__).parent.parent
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
    assert row in (ROOT / "docs" / "protocol.md").read_text(encoding="utf-8")
