"""What the learners of DQN and MMN share: the replay and its hindsight, descending, and files to go on from exactly."""

from __future__ import annotations

import copy
import dataclasses
import json
import pathlib
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch

from mazebench.errors import InputError
from mazebench.maps.maze import Maze
from mazebench.records import read_json
from mazebench.tasks.context import build_context
from mazebench.training.experience import Experience
from mazebench.world.mjcf import ACTIONS

from . import symmetry
from .checkpoint import AGENT_FILE, load_checkpoint, load_into, save_checkpoint
from .replay import Hindsight, Replay, Sample, SequenceSample

_TRAINING_FILE = "training.safetensors"
_RANDOM_FILE = "random.json"
_REPLAY_FILE = "replay.npz"
_MOMENTS = {"step", "exp_avg", "exp_avg_sq"}  # Adam's


class HindsightLearner:
    """Remembers and learns for an agent, which acts with what is learned so far; `update` is its children's."""

    def __init__(
        self,
        actor: Any,
        mazes: tuple[Maze, ...],
        seed: int,
        optimizer: torch.optim.Optimizer,
        keep_anchor: bool = False,
    ):
        """`optimizer` is of the actor's network; the actor has name, config, network and context_size_built.

        `keep_anchor` is a `Hindsight`'s.
        """
        self.actor = actor
        config = self._config = actor.config
        self.num_envs = config.num_envs
        self._mazes = mazes
        self._rng = np.random.default_rng([seed, 1])
        self._target = copy.deepcopy(actor.network).requires_grad_(False)
        self._optimizer = optimizer
        self._replay = Replay(config.num_envs, config.replay_capacity, config.priority_exponent)
        self._hindsight = Hindsight(
            config.hindsight_ratio,
            config.hindsight_mean_offset,
            config.hindsight_window,
            config.relabel_start,
            keep_anchor,
        )
        self._arrays: dict[str, np.ndarray] = {}  # what a child wants to find again when it goes on

    def config(self) -> dict[str, Any]:
        """All values of the config."""
        return dataclasses.asdict(self._config)

    def description(self) -> str:
        """The size of the network and of the replay, and where it learns."""
        parameters = list(self.actor.network.parameters())
        weights = sum(parameter.numel() for parameter in parameters)
        rows, megabytes = self._config.replay_capacity, self._replay.num_bytes / 2**20
        return f"{weights:,} weights on {parameters[0].device}; replay of {rows:,} rows, {megabytes:.0f} MiB"

    def task_options(self) -> dict[str, Any]:
        """Episodes of several goals, as the config has it."""
        return {"num_goals": self._config.num_goals}

    def observe(self, experience: Experience, first_env: int = 0) -> None:
        """Remembers one step in the environments from `first_env` on."""
        self._replay.add(experience, first_env)

    def num_updates_due(self, env_steps: int) -> int:
        """One update every `steps_per_update` steps after the first `min_rows`; none while the replay is not filled."""
        if self._replay.num_rows < self._config.min_rows:
            return 0
        return max(0, env_steps - self._config.min_rows) // self._config.steps_per_update

    def save(self, folder: pathlib.Path, provenance: Mapping[str, Any]) -> None:
        """Writes the agent, the target network and optimizer, the random stream and the replay."""
        metadata = {
            "agent": self.actor.name,
            "config": self.config(),
            "context_size": self.actor.context_size_built,
            "provenance": dict(provenance),
        }
        save_checkpoint(folder / AGENT_FILE, self.actor.network.state_dict(), metadata)
        tensors = {f"target.{name}": value for name, value in self._target.state_dict().items()}
        tensors |= {f"array.{name}": torch.from_numpy(array) for name, array in self._arrays.items()}
        for index, moments in self._optimizer.state_dict()["state"].items():
            tensors |= {f"optimizer.{index}.{name}": torch.as_tensor(value) for name, value in moments.items()}
        save_checkpoint(folder / _TRAINING_FILE, tensors, {"agent": self.actor.name})
        (folder / _RANDOM_FILE).write_text(json.dumps(self._rng.bit_generator.state), encoding="ascii")
        self._replay.save(folder / _REPLAY_FILE)

    def load(self, folder: pathlib.Path) -> None:
        """Goes on from what `save` wrote; where the replay is gone, learning waits until it is filled again.

        Raises:
          InputError: if a file is damaged, or another agent's.
        """
        tensors, _ = load_checkpoint(folder / AGENT_FILE, self.actor.name)
        load_into(folder / AGENT_FILE, self.actor.network, tensors)
        path = folder / _TRAINING_FILE
        tensors, _ = load_checkpoint(path, self.actor.name)
        load_into(path, self._target, _below("target.", tensors))
        arrays = _below("array.", tensors)
        for name, array in self._arrays.items():
            found = arrays.get(name, torch.zeros(0))
            if found.shape != array.shape or found.dtype != torch.from_numpy(array).dtype:
                raise InputError(f"{path}: expected {name} {array.shape}, found {tuple(found.shape)}")
            array[...] = found.numpy()
        self._load_optimizer(path, _below("optimizer.", tensors))
        self._load_random(folder / _RANDOM_FILE)
        path = folder / _REPLAY_FILE
        if path.exists():
            self._replay.load(path)
            if not self._replay.fits(len(self._mazes), self._mazes[0].size ** 2, len(ACTIONS)):
                raise InputError(f"{path}: expected the replay of these {len(self._mazes)} mazes, found another")

    def _load_optimizer(self, path: pathlib.Path, tensors: Mapping[str, torch.Tensor]) -> None:
        moments: dict[int, dict[str, torch.Tensor]] = {}
        shapes = [parameter.shape for group in self._optimizer.param_groups for parameter in group["params"]]
        for name, value in tensors.items():
            index, _, moment = name.partition(".")
            is_known = index.isdecimal() and int(index) < len(shapes)
            if not is_known or value.shape != (() if moment == "step" else shapes[int(index)]):
                found = f"{name} {tuple(value.shape)}"
                raise InputError(f"{path}: expected moments of {len(shapes)} parameters, found {found}")
            if (
                value.dtype != torch.float32
                or not torch.isfinite(value).all()
                or (moment == "step" and value.min() < 1)
            ):
                raise InputError(f"{path}: expected finite moments after some steps, found others in {name}")
            moments.setdefault(int(index), {})[moment] = value
        if any(names.keys() != _MOMENTS for names in moments.values()):
            raise InputError(f"{path}: expected {', '.join(sorted(_MOMENTS))} of each parameter, found others")
        groups = self._optimizer.state_dict()["param_groups"]
        self._optimizer.load_state_dict({"state": moments, "param_groups": groups})

    def _load_random(self, path: pathlib.Path) -> None:
        try:
            self._rng.bit_generator.state = read_json(path)
        except (TypeError, ValueError, KeyError, OverflowError) as error:
            if isinstance(error, InputError):
                raise
            raise InputError(f"{path}: expected the state of a random stream, found {str(error)[:120]}") from error

    def _draw_symmetry(self) -> int:
        """How a batch is rotated or mirrored."""
        return int(self._rng.integers(symmetry.NUM_SYMMETRIES)) if self._config.symmetries else 0

    def _contexts(self, sample: Sample | SequenceSample, turned: int) -> torch.Tensor:
        """`[G, 4, M, M]`: the contexts of a sample's groups, turned."""
        size = self._mazes[0].size
        contexts = [
            build_context(
                self._mazes[maze].walls, divmod(start, size), divmod(goal, size), self.actor.context_size_built
            )
            for maze, start, goal in zip(sample.maze.tolist(), sample.start.tolist(), sample.goal.tolist(), strict=True)
        ]
        return symmetry.turn_planes(torch.from_numpy(np.stack(contexts)), turned)

    def _marks(self, cell: np.ndarray, turned: int) -> torch.Tensor:
        """`[G, 2]`: where (row, column) contexts mark cells `[G]`, on the turned map."""
        size, context_size = self._mazes[0].size, self.actor.context_size_built
        marks = torch.from_numpy(np.stack(np.divmod(cell, size), axis=-1) * context_size // size).float()
        return symmetry.turn_cells(marks, context_size, turned)

    def _places(self, sample: Sample | SequenceSample, turned: int) -> torch.Tensor:
        """`[..., 2]`: where on the turned map, (row, column), the cells of a sample's steps are."""
        size = self._mazes[0].size
        cells = torch.from_numpy(np.stack(np.divmod(sample.cell, size), axis=-1)).float()
        return symmetry.turn_cells(cells, size, turned) * (self.actor.context_size_built / size)

    def _descend(self, loss: torch.Tensor) -> torch.Tensor:
        """One step of the optimizer, and the target network's after it; returns the gradient's norm."""
        self._optimizer.zero_grad()
        loss.backward()
        network = self.actor.network
        norm = torch.nn.utils.clip_grad_norm_(network.parameters(), self._config.max_gradient_norm)
        self._optimizer.step()
        with torch.no_grad():
            for slow, fast in zip(self._target.parameters(), network.parameters(), strict=True):
                slow.lerp_(fast, self._config.target_rate)
        return norm


def _below(prefix: str, tensors: Mapping[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    """Those whose names begin with `prefix`, by the rest of the name."""
    return {name.removeprefix(prefix): tensor for name, tensor in tensors.items() if name.startswith(prefix)}
