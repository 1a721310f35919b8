"""What a learner needs to go on exactly as it would have: written beside its agent's checkpoint, and read back."""

from __future__ import annotations

import json
import pathlib
from collections.abc import Mapping
from types import MappingProxyType

import numpy as np
import torch

from mazebench.errors import InputError

from .checkpoint import load_checkpoint, load_into, save_checkpoint
from .replay import Replay

_TRAINING_FILE = "training.safetensors"
_RANDOM_FILE = "random.json"
_REPLAY_FILE = "replay.npz"


def save_learner(
    folder: pathlib.Path,
    agent: str,
    target: torch.nn.Module,
    optimizer: torch.optim.Optimizer,
    rng: np.random.Generator,
    replay: Replay,
    arrays: Mapping[str, np.ndarray] = MappingProxyType({}),
) -> None:
    """Writes the target network, the optimizer, the random stream, the replay and `arrays` of a learner of `agent`."""
    tensors = {f"target.{name}": value for name, value in target.state_dict().items()}
    tensors |= {f"array.{name}": torch.from_numpy(array) for name, array in arrays.items()}
    for index, moments in optimizer.state_dict()["state"].items():
        tensors |= {f"optimizer.{index}.{name}": torch.as_tensor(value) for name, value in moments.items()}
    save_checkpoint(folder / _TRAINING_FILE, tensors, {"agent": agent})
    (folder / _RANDOM_FILE).write_text(json.dumps(rng.bit_generator.state), encoding="ascii")
    replay.save(folder / _REPLAY_FILE)


def load_learner(
    folder: pathlib.Path,
    agent: str,
    target: torch.nn.Module,
    optimizer: torch.optim.Optimizer,
    rng: np.random.Generator,
    replay: Replay,
    arrays: Mapping[str, np.ndarray] = MappingProxyType({}),
) -> None:
    """Puts what `save_learner` wrote in place, also in `arrays`; a replay that is gone stays empty.

    Raises:
      InputError: if a file is damaged, or another agent's.
    """
    path = folder / _TRAINING_FILE
    tensors, _ = load_checkpoint(path, agent)
    weights = {name.removeprefix("target."): value for name, value in tensors.items() if name.startswith("target.")}
    load_into(path, target, weights)
    for name, array in arrays.items():
        found = tensors.get(f"array.{name}", torch.zeros(0)).numpy()
        if found.shape != array.shape:
            raise InputError(f"{path}: expected {name} {array.shape}, found {found.shape}")
        array[...] = found
    moments: dict[int, dict[str, torch.Tensor]] = {}
    for name, value in tensors.items():
        if name.startswith("optimizer."):
            _, index, moment = name.split(".")
            moments.setdefault(int(index), {})[moment] = value
    groups = optimizer.state_dict()["param_groups"]
    optimizer.load_state_dict({"state": moments, "param_groups": groups})
    rng.bit_generator.state = json.loads((folder / _RANDOM_FILE).read_text(encoding="ascii"))
    if (folder / _REPLAY_FILE).exists():
        replay.load(folder / _REPLAY_FILE)
