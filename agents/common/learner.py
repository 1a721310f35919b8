"""The parts that all learners hold, and their contract but for `update`, which each learner defines in its own file."""

from __future__ import annotations

import dataclasses
import json
import pathlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from mazebench.errors import InputError
from mazebench.storage.json_files import read_json
from mazebench.tasks.task import Task
from mazebench.training.experience import Experience, Scene

from .actor import NetworkAgent
from .checkpoint import AGENT_FILE, load_checkpoint, save_checkpoint
from .descent import Descent
from .replay import Hindsight, Replay
from .training_maps import TrainingMaps, shows_other_maps

_TRAINING_FILE = "training.safetensors"
_RANDOM_FILE = "random.json"
REPLAY_FILE = "replay.npz"


class NetworkLearner:
    """The parts of every learner: an actor, gradient steps of its network, and a random stream."""

    drive_steps = 0
    share_done = 0.0

    def __init__(self, actor: NetworkAgent, seed: int, descent: Descent):
        """`descent` is of the actor's network."""
        self.actor = actor
        self.num_envs: int = actor.config.num_envs
        self.descent = descent
        self.rng = np.random.default_rng([seed, 1])

    def config(self) -> dict[str, Any]:
        """Returns all values of the config."""
        return dataclasses.asdict(self.actor.config)

    def driven(self, scene: Scene, actions: np.ndarray) -> np.ndarray:
        """Returns the actions that the actor chose."""
        return actions

    def save(self, folder: pathlib.Path, provenance: Mapping[str, Any]) -> None:
        """Writes the agent, the optimizer with the target network if there is one, and the random generator."""
        self.actor.save(folder / AGENT_FILE, provenance)
        save_checkpoint(folder / _TRAINING_FILE, self.descent.tensors(), {"agent": self.actor.name})
        (folder / _RANDOM_FILE).write_text(json.dumps(self.rng.bit_generator.state), encoding="ascii")

    def load(self, folder: pathlib.Path) -> None:
        """Restores what `save` wrote.

        Raises:
          InputError: if a file is damaged, or another agent's.
        """
        self.actor.load(folder / AGENT_FILE)
        tensors, _ = load_checkpoint(folder / _TRAINING_FILE, self.actor.name)
        self.descent.load(tensors)
        path = folder / _RANDOM_FILE
        state = read_json(path)
        try:
            self.rng.bit_generator.state = state
        except (TypeError, ValueError, KeyError, OverflowError) as error:
            raise InputError(f"{path}: expected the state of a random generator, found {error!r}"[:200]) from error


class HindsightLearner(NetworkLearner):
    """Holds the parts of a learner from relabelled experience: replay, maps, gradient steps and a random stream."""

    def __init__(
        self,
        actor: NetworkAgent,
        task: Task,
        seed: int,
        descent: Descent,
        *,
        keep_anchor: bool = False,
        priority_exponent: float = 0.0,
    ):
        """`descent` is of the actor's network; `keep_anchor` and `priority_exponent` are those of the replay.

        Raises:
          InputError: if the actor's network does not read the task's maps or sensors.
        """
        super().__init__(actor, seed, descent)
        config = actor.config
        self.min_rows: int = config.min_rows
        self.steps_per_update: int = config.steps_per_update
        self.maps = TrainingMaps(task)
        self.replay = Replay(
            config.num_envs,
            config.replay_capacity,
            priority_exponent,
            map_size=task.size if shows_other_maps(task, actor.name) else 0,
        )
        self.hindsight = Hindsight(
            ratio=config.hindsight_ratio,
            mean_offset=config.hindsight_mean_offset,
            window=config.hindsight_window,
            relabel_start=config.relabel_start,
            keep_anchor=keep_anchor,
        )

    @property
    def num_rows(self) -> int:
        """The number of rows that the replay holds."""
        return self.replay.num_rows

    def description(self) -> str:
        """Returns the size of the network and of the replay, and the device, in one line."""
        parameters = list(self.actor.network.parameters())
        weights = sum(parameter.numel() for parameter in parameters)
        rows, megabytes = self.actor.config.replay_capacity, self.replay.num_bytes / 2**20
        return f"{weights:,} weights on {parameters[0].device}; replay of {rows:,} rows, {megabytes:.0f} MiB"

    def observe(self, experience: Experience) -> None:
        """Stores one step in all environments."""
        self.replay.add(experience)

    def save(self, folder: pathlib.Path, provenance: Mapping[str, Any]) -> None:
        """Writes what every learner does, and the replay."""
        super().save(folder, provenance)
        self.replay.save(folder / REPLAY_FILE)

    def load(self, folder: pathlib.Path) -> None:
        """Restores what `save` wrote; without the replay file, learning waits until the replay is filled again.

        Raises:
          InputError: if a file is damaged, or another agent's.
        """
        super().load(folder)
        path = folder / REPLAY_FILE
        if path.exists():
            self.replay.load(path)
