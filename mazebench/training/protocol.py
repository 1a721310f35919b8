"""The contract of an agent that learns, and of the learner that the training loop drives.

`B` is the number of environments that experience is collected in.
"""

from __future__ import annotations

import pathlib
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from mazebench.agent import Agent, Interface
from mazebench.maps.maze import Maze
from mazebench.tasks.spec import TaskSpec
from mazebench.training.experience import Experience


class LearningAgent(Agent):
    """An agent that can be trained; the base class of all that can.

    It acts both in evaluations and, exploring, in the environments that experience is collected in. The stream of
    exploration that `explore_from` begins is the one thing that it may keep on itself.
    """

    learns = True

    @classmethod
    def build_learner(
        cls, interface: Interface, mazes: Sequence[Maze], *, seed: int = 0, overrides: Mapping[str, str] | None = None
    ) -> Learner:
        """Returns a new learner.

        Args:
          interface: the environments to learn in.
          mazes: their mazes; `Experience.maze` counts them.
          seed: of all that is drawn.
          overrides: values of the agent's config as text, by name.

        Raises:
          InputError: if a name or a value in `overrides` is not of the config.
        """
        raise NotImplementedError

    def explore_from(self, first_env: int, num_envs: int, seed: int) -> None:
        """Begins a new stream of exploration, as the environments from `first_env` on of the learner's."""
        raise NotImplementedError

    def parameters(self) -> dict[str, np.ndarray]:
        """Returns what was learned, by name, for `set_parameters` of a copy of this agent."""
        raise NotImplementedError

    def set_parameters(self, parameters: dict[str, np.ndarray]) -> None:
        """Takes over what another copy returned as its `parameters`."""
        raise NotImplementedError


class Learner(Protocol):
    """What the training loop needs beside acting."""

    @property
    def num_envs(self) -> int:
        """B."""

    @property
    def actor(self) -> LearningAgent:
        """The agent, which acts with what is learned so far."""

    def config(self) -> dict[str, Any]:
        """Returns all values that the learner was built with, as plain data."""

    def description(self) -> str:
        """Returns one line for people: the size of the network and of the replay."""

    def task_options(self) -> dict[str, Any]:
        """Returns the options of the task that the learner wants to collect with, unless the user asks for others.

        They are fields of `TaskOptions`, but not those that choose mazes or context size: `track` and `level`.
        """

    def prepare(self, task: TaskSpec) -> None:
        """Prepares to learn in `task`, before the first experience.

        Raises:
          InputError: if the learner can't, because its network does not take a sensor, or it needs exact maps.
        """

    def observe(self, experience: Experience, first_env: int = 0) -> None:
        """Stores one step in the environments from `first_env` on."""

    def num_updates_due(self, env_steps: int) -> int:
        """Returns how many updates should have been made after `env_steps` agent steps; the replay ratio is fixed."""

    def update(self) -> dict[str, float]:
        """Learns from one batch; returns losses and other scalars by name."""

    def save(self, folder: pathlib.Path, provenance: Mapping[str, Any]) -> None:
        """Writes `agent.safetensors`, which acting needs, and all that `load` needs to go on exactly."""

    def load(self, folder: pathlib.Path) -> None:
        """Restores what `save` wrote.

        Where the replay was deleted, the learner fills it again before it goes on learning.
        """
