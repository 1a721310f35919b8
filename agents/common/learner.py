"""The parts that all learners share: replay with hindsight, gradient steps, saving and loading."""

from __future__ import annotations

import copy
import dataclasses
import json
import pathlib
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch

from mazebench.constants import ACTIONS
from mazebench.errors import InputError
from mazebench.maps.maze import Maze
from mazebench.storage.json_files import read_json
from mazebench.tasks.context import build_context
from mazebench.tasks.episode import sample_episode
from mazebench.tasks.perturbations import active_perturbations
from mazebench.tasks.shown_map import show_map
from mazebench.tasks.spec import TaskSpec
from mazebench.training.experience import Experience

from . import symmetry
from .actor import NetworkAgent
from .checkpoint import AGENT_FILE, load_checkpoint, load_into, save_checkpoint
from .replay import Hindsight, Replay, Sample, SequenceSample

_TRAINING_FILE = "training.safetensors"
_RANDOM_FILE = "random.json"
_REPLAY_FILE = "replay.npz"
_MOMENTS = {"step", "exp_avg", "exp_avg_sq"}  # Adam's


class HindsightLearner:
    """Stores experience and updates the network of `actor`; subclasses define `update`."""

    def __init__(
        self,
        actor: NetworkAgent,
        mazes: tuple[Maze, ...],
        seed: int,
        optimizer: torch.optim.Optimizer,
        keep_anchor: bool = False,
        priority_exponent: float = 0.0,
    ):
        """`optimizer` is of the actor's network; `keep_anchor` and `priority_exponent` are those of the replay."""
        self.actor = actor
        config = self._config = actor.config
        self.num_envs = config.num_envs
        self._mazes = mazes
        self._rng = np.random.default_rng([seed, 1])
        self._target = copy.deepcopy(actor.network).requires_grad_(False)
        self._optimizer = optimizer
        self._replay = Replay(config.num_envs, config.replay_capacity, priority_exponent)
        self._hindsight = Hindsight(
            config.hindsight_ratio,
            config.hindsight_mean_offset,
            config.hindsight_window,
            config.relabel_start,
            keep_anchor,
        )
        self._arrays: dict[str, np.ndarray] = {}  # of a subclass, saved and loaded with the rest

    def config(self) -> dict[str, Any]:
        """Returns all values of the config."""
        return dataclasses.asdict(self._config)

    def description(self) -> str:
        """Returns the size of the network and of the replay, and the device, in one line."""
        parameters = list(self.actor.network.parameters())
        weights = sum(parameter.numel() for parameter in parameters)
        rows, megabytes = self._config.replay_capacity, self._replay.num_bytes / 2**20
        return f"{weights:,} weights on {parameters[0].device}; replay of {rows:,} rows, {megabytes:.0f} MiB"

    def task_options(self) -> dict[str, Any]:
        """Returns the number of goals of an episode, as configured."""
        return {"num_goals": self._config.num_goals}

    def prepare(self, task: TaskSpec) -> None:
        """Makes the replay keep the shown maps of a task in which they may not be those of the mazes.

        Raises:
          InputError: if the maps are drawn or lack marks, or a sensor is asked for, which the network does not read.
        """
        name = f"agent {self.actor.name!r}"
        if task.track is None and task.sensors:
            raise InputError(f"{name}: reads no sensors, found {', '.join(task.sensors)}")
        if task.track is None and not active_perturbations(task):
            return
        episode = sample_episode(task, np.random.default_rng(0))
        shown = [show_map(dataclasses.replace(task, level=(level,)), episode) for level in task.level]
        if any(each.drawing is not None or each.hidden for each in shown):
            found = "map_warp" if task.track is None else f"track {task.track!r}"
            raise InputError(
                f"{name}: learns only on maps of one pixel a cell with start and goal marked; found {found}"
            )
        if task.context_size != task.size:
            raise InputError(
                f"{name}: learns on tracks and with perturbations from contexts of the maze's size {task.size}, "
                f"found {task.context_size}"
            )
        self._replay.keep_maps(task.size)

    def observe(self, experience: Experience, first_env: int = 0) -> None:
        """Stores one step in the environments from `first_env` on."""
        self._replay.add(experience, first_env)

    def num_updates_due(self, env_steps: int) -> int:
        """Returns one a `steps_per_update` steps after the first `min_rows`; 0 until the replay holds as many rows."""
        if self._replay.num_rows < self._config.min_rows:
            return 0
        return max(0, env_steps - self._config.min_rows) // self._config.steps_per_update

    def save(self, folder: pathlib.Path, provenance: Mapping[str, Any]) -> None:
        """Writes the agent, the target network, the optimizer, the random generator and the replay."""
        metadata = {
            "agent": self.actor.name,
            "config": self.config(),
            "context_size": self.actor.trained_size,
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
        """Restores what `save` wrote; without the replay file, learning waits until the replay is filled again.

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
        """Returns the index of the symmetry that a batch is turned by; 0 leaves it as it is."""
        return int(self._rng.integers(symmetry.NUM_SYMMETRIES)) if self._config.symmetries else 0

    def _contexts(self, sample: Sample | SequenceSample, turned: int) -> torch.Tensor:
        """Returns the turned contexts `[G, 4, M, M]` of a sample's groups."""
        size = self._mazes[0].size
        shown = [self._mazes[maze].walls for maze in sample.maze] if sample.shown is None else sample.shown
        contexts = [
            build_context(walls, divmod(start, size), divmod(goal, size), self.actor.trained_size)
            for walls, start, goal in zip(shown, sample.start.tolist(), sample.goal.tolist(), strict=True)
        ]
        return symmetry.turn_planes(torch.from_numpy(np.stack(contexts)), turned)

    def _marks(self, cell: np.ndarray, turned: int) -> torch.Tensor:
        """Returns the positions `[G, 2]` at which turned contexts mark the cells `[G]`."""
        size, context_size = self._mazes[0].size, self.actor.trained_size
        marks = torch.from_numpy(np.stack(np.divmod(cell, size), axis=-1) * context_size // size).float()
        return symmetry.turn_cells(marks, context_size, turned)

    def _positions(self, sample: Sample | SequenceSample, turned: int) -> torch.Tensor:
        """Returns the positions `[..., 2]` of a sample's true cells on the turned map."""
        size = self._mazes[0].size
        cells = torch.from_numpy(np.stack(np.divmod(sample.cell, size), axis=-1)).float()
        return symmetry.turn_cells(cells, size, turned) * (self.actor.trained_size / size)

    def _descend(self, loss: torch.Tensor) -> torch.Tensor:
        """Takes one step of the optimizer, moves the target network along, and returns the gradient's norm."""
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
    """Returns the tensors whose names begin with `prefix`, by the rest of the name."""
    return {name.removeprefix(prefix): tensor for name, tensor in tensors.items() if name.startswith(prefix)}
