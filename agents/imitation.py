"""Imitation of the oracle (DAgger: Ross et al. 2011): the agents that learn by it, and the one learner that they share.

An agent needs no more than `ImitatingAgent` says; the training loop collects, saves, resumes and evaluates.
`R` is the number of steps in all environments together.
"""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

import numpy as np
import torch
from annotated_types import Interval
from torch.nn import functional

from mazebench.constants import NUM_ACTIONS
from mazebench.errors import InputError
from mazebench.storage.array_files import read_arrays
from mazebench.tasks.task import Task
from mazebench.training.experience import Experience, Scene

from .common.actor import NetworkAgent
from .common.config_values import Length, Share
from .common.learner import REPLAY_FILE
from .common.rollouts import RolloutConfig, RolloutLearner, Rows, Seen
from .expert import Expert

DriveSteps = Annotated[int, Interval(ge=0, le=1000)]


@dataclasses.dataclass(frozen=True, kw_only=True)
class ImitationConfig(RolloutConfig):
    """The numbers of an imitation."""

    oracle_drives: Share = 0.0  # in so many of the environments the oracle drives, in the others the agent
    random_actions: Share = 0.25  # of the oracle's actions are replaced by random ones, so that it strays
    # Agent steps after which new episodes begin, 0 for none: drives to the end show few maps, and few states far away.
    drive_steps: DriveSteps = 0
    kept_rollouts: Length = 25  # that imitation learns from: on few of them, the network learns their mazes by heart
    # m; an action that leaves so much more way is e times less wanted.
    label_temperature: Annotated[float, Interval(ge=0.001, le=10.0)] = 0.08


class ImitationLearner(RolloutLearner):
    """Learns to choose what the oracle would choose in the states that its actor, or the oracle, drives into."""

    teacher = "the oracle"
    actor: ImitatingAgent

    def __init__(self, actor: ImitatingAgent, task: Task, seed: int):
        """The oracle knows the true mazes of `task`."""
        super().__init__(actor, seed)
        self.num_kept, self.drive_steps = actor.config.kept_rollouts, actor.config.drive_steps
        self.num_ahead = 0 if self.drive_steps else 1  # no step of a drive that is cut goes with those of another one
        self._expert = Expert(task.standing, actor.config.num_envs, task.body)

    def driven(self, scene: Scene, actions: np.ndarray) -> np.ndarray:
        """Returns the oracle's actions, some of them random, in the first environments, and the actor's in the rest."""
        num_driven = round(self._config.oracle_drives * len(actions))
        if not num_driven:
            return actions
        best = self._expert.costs(scene.maze, scene.goal, scene.pose, scene.velocity, scene.step, scene.doors)[
            :num_driven
        ].argmin(axis=1)
        at_random = self.rng.random(num_driven) < self._config.random_actions
        best = np.where(at_random, self.rng.integers(NUM_ACTIONS, size=num_driven), best)
        return np.concatenate([best, actions[num_driven:]])

    def seen(self, experience: Experience) -> Seen:
        """Adds the oracle's label, the probabilities of actions by its look-ahead from the true state."""
        truth = experience.maze, experience.goal, experience.pose, experience.velocity
        costs = self._expert.costs(*truth, experience.step, experience.doors)
        weights = np.exp(-(costs - costs.min(axis=1, keepdims=True)) / self._config.label_temperature)
        label = (weights / weights.sum(axis=1, keepdims=True)).astype(np.float32)
        return Seen(experience.notes.shared, (*experience.notes.parts, label))

    def losses(self, rows: Rows) -> dict[str, torch.Tensor]:
        """Returns the cross-entropy of labels and policy, and how often the best actions of both are the same."""
        label = rows.parts[-1]
        log_probabilities, scalars = self.actor.read(rows._replace(parts=rows.parts[:-1]))
        loss = -(label * log_probabilities).sum(dim=1).mean()
        agreement = (log_probabilities.argmax(dim=1) == label.argmax(dim=1)).float().mean()
        return {"loss": loss, "imitation_loss": loss, "agreement": agreement, **scalars}

    def save(self, folder: pathlib.Path, provenance: Mapping[str, Any]) -> None:
        """Writes what every learner does, and the rollouts that are kept."""
        super().save(folder, provenance)
        arrays: dict[str, Any] = {
            f"{number}-{size}-{part}": array.numpy()
            for number, rollout in enumerate(self._kept)
            for size, rows in rollout.items()
            for part, array in enumerate((rows.shared, rows.group, *rows.parts))
        }
        with (folder / REPLAY_FILE).open("wb") as file:
            np.savez_compressed(file, **arrays)

    def load(self, folder: pathlib.Path) -> None:
        """Restores what `save` wrote; without the rollouts' file, imitation begins with new ones.

        Raises:
          InputError: if a file is damaged, or another agent's.
        """
        super().load(folder)
        self._kept = []
        path = folder / REPLAY_FILE
        if not path.exists():
            return
        arrays = read_arrays(path, "file of rollouts")
        try:
            for number, size, num_parts in _last_parts(arrays):
                self._kept += [{} for _ in range(number + 1 - len(self._kept))]
                found = [torch.from_numpy(arrays[f"{number}-{size}-{part}"]) for part in range(num_parts)]
                shared, index, *parts = found
                self._kept[number][size] = Rows(shared, index, tuple(parts))
        except (KeyError, ValueError) as error:
            raise InputError(f"{path}: expected rollouts, found a damaged file: {error}") from error


class ImitatingAgent(NetworkAgent):
    """An agent that learns by imitation; all that a new one needs, besides a folder and an entry point.

    A subclass declares `name`, `default_config`, an `ImitationConfig` with fields of its own, and `needs_sensors`. It
    defines four methods:

    - `make_network(config, context_size)`, which returns the torch.nn.Module that learns.
    - `act(inputs, state, explore)`, decorated by `acting`, which returns actions `[B]` and the state. It keeps what the
      network read in the state, and computes by `in_batches`, so that a result depends on its own environment alone.
    - `notes(state)`, which returns that as `Seen`.
    - `read(rows)`, if the network is to be called otherwise than on what `Seen.shared` has of each step.

    It explores by nothing but its own choices.
    """

    learner_class: ClassVar[Any] = ImitationLearner

    @classmethod
    def task_options(cls, overrides: Mapping[str, str] | None = None) -> dict[str, Any]:
        """Returns one goal an episode."""
        return {"num_goals": 1}

    def explore_from(self, seed: int) -> None:
        """Begins no stream: all draws follow from the seeds of the episodes."""

    def notes(self, state: Any) -> Seen:
        """Returns what the network read in the last step."""
        raise NotImplementedError

    def read(self, rows: Rows) -> tuple[torch.Tensor, dict[str, torch.Tensor]]:
        """Returns log probabilities `[R, 6]` of actions in rows, and scalars to log by name; called with gradients."""
        return functional.log_softmax(self.network(rows.shared[rows.group], *rows.parts), dim=1), {}


def _last_parts(arrays: Mapping[str, Any]) -> list[tuple[int, int, int]]:
    """Returns number, size and count of the arrays of each rollout and size that a file holds."""
    counts: dict[tuple[int, int], int] = {}
    for name in arrays:
        number, size, _ = map(int, name.split("-"))
        counts[number, size] = counts.get((number, size), 0) + 1
    return sorted((*key, count) for key, count in counts.items())
