"""Checkpoints: what is saved comes back; what is damaged, foreign or hostile is refused in one line."""

import json
import pickle
import struct

import numpy as np
import pytest
import torch
from mazebench_agents.checkpoint import load_checkpoint, save_checkpoint
from mazebench_agents.dqn import DQN, MAH

from mazebench.agent import Interface
from mazebench.errors import InputError

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


def test_saved_and_loaded_agent_acts_identically(tmp_path):

    agent = MAH(MAH.default_config, 13, seed=5)
    with torch.no_grad():
        agent.network.advantage.weight.mul_(50)  # so that observations decide, not biases
    path = tmp_path / "agent.safetensors"
    save_checkpoint(path, agent.network.state_dict(), {"agent": "mah", "config": {}, "context_size": 13})
    loaded = MAH.build(INTERFACE, checkpoint=path)
    rng = np.random.default_rng(0)
    observation = {
        "state": rng.normal(size=(32, 12)).astype(np.float32),
        "context": (rng.random((32, 4, 13, 13)) < 0.3).astype(np.float32),
    }
    first = np.ones(32, dtype=bool)
    actions = [model.act(observation, first, model.initial_state(32))[0] for model in (agent, loaded)]
    np.testing.assert_array_equal(*actions)
    assert len(set(actions[0].tolist())) > 1


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda content: b"", "header"),
        (lambda content: content[: len(content) // 2], "damaged"),
        (lambda content: pickle.dumps({"weights": 1}), "header"),
        (lambda content: struct.pack("<Q", 2**62) + content[8:], "header"),
        (lambda content: struct.pack("<Q", 2**20 + 1) + b"{" + b" " * 2**21, "header"),
        (lambda content: content[:8] + b"\xff" * 64 + content[72:], "header"),
    ],
    ids=["empty", "truncated", "pickle", "absurd header", "huge header", "no json"],
)
def test_damaged_checkpoint_is_refused_in_one_line(tmp_path, spoil, message):
    path = saved(tmp_path)
    path.write_bytes(spoil(path.read_bytes()))
    with pytest.raises(InputError, match=message) as caught:
        MAH.build(INTERFACE, checkpoint=path)
    assert "\n" not in str(caught.value)


def test_another_agents_checkpoint_is_refused(tmp_path):
    with pytest.raises(InputError, match="expected a checkpoint of agent 'dqn', found one of 'mah'"):
        DQN.build(INTERFACE, checkpoint=saved(tmp_path))


def test_checkpoint_of_another_network_is_refused_by_its_first_wrong_tensor(tmp_path):
    with pytest.raises(InputError, match=r"expected advantage.weight \(6, 32\), found \(6, 256\)"):
        MAH.build(INTERFACE, checkpoint=saved(tmp_path, config={"hidden": 32}))


@pytest.mark.parametrize("config", [{"colour": 1}, {"hidden": "many"}, [1]])
def test_checkpoint_with_a_wrong_config_is_refused(tmp_path, config):
    with pytest.raises(InputError):
        MAH.build(INTERFACE, checkpoint=saved(tmp_path, config=config))


def test_missing_checkpoint_is_refused(tmp_path):
    with pytest.raises(InputError, match="can't read the checkpoint"):
        MAH.build(INTERFACE, checkpoint=tmp_path / "none")


def test_metadata_is_plain_json_in_the_header(tmp_path):
    content = saved(tmp_path).read_bytes()
    header = json.loads(content[8 : 8 + struct.unpack("<Q", content[:8])[0]])
    assert json.loads(header["__metadata__"]["mazebench-agent-1"])["agent"] == "mah"
