"""The contract of an agent that learns, and of the learner that the training loop drives.

`B` is the number of environments that experience is collected in.
"""

from __future__ import annotations

import pathlib
from collections.abc import Mapping
from typing import Any, ClassVar, Protocol, Self

import numpy as np

from mazebench.agent import Agent, Interface
from mazebench.tasks.task import Task
from mazebench.training.experience import Experience, Scene


class LearningAgent(Agent):
    """An agent that can be trained; the base class of all that can.

    It acts both in evaluations and, exploring, in the environments that experience is collected in. The stream of
    exploration that `explore_from` begins is the one thing that it may keep on itself.
    """

    learns = True
    learns_several_tasks: ClassVar[bool] = False  # at once, in the same environments

    @classmethod
    def task_options(cls, overrides: Mapping[str, str] | None = None) -> dict[str, Any]:
        """Returns the options of the task that a learner is to collect in, unless the user asks for others; here none.

        They are fields of `TaskOptions`, but not those that choose mazes, track, level or context size.

        Args:
          overrides: values of the agent's config as text, by name.

        Raises:
          InputError: if a name or a value in `overrides` is not of the config.
        """
        return {}

    @classmethod
    def build_learner(cls, task: Task, *, seed: int = 0, overrides: Mapping[str, str] | None = None) -> Learner:
        """Returns a new learner, which is ready to learn.

        Args:
          task: the task to learn in, of several the first one, with their mazes; `Experience.maze` counts them.
          seed: of all that is drawn.
          overrides: values of the agent's config as text, by name.

        Raises:
          InputError: if a name or a value in `overrides` is not of the config, or the learner can't learn in `task`:
            because its network does not take a sensor, say, or it needs exact maps.
        """
        raise NotImplementedError

    def for_interface(self, interface: Interface) -> Self:
        """Returns the agent for the environments of an interface, those of one or of all tasks of the training.

        What is learned is shared with this agent. By default it is this agent.
        """
        return self

    def notes(self, state: Any) -> Any:
        """Returns what the learner needs of the step that was chosen last in `state`, such as probabilities."""
        return None

    def explore_from(self, seed: int) -> None:
        """Begins a new stream of exploration."""
        raise NotImplementedError


class Learner(Protocol):
    """The contract of agents that learn, besides acting."""

    share_done: float  # of the run, from 0 to 1: the training loop sets it before each update, for schedules

    @property
    def num_envs(self) -> int:
        """B."""

    @property
    def min_rows(self) -> int:
        """The first update is made after so many agent steps, once as many rows are stored."""

    @property
    def steps_per_update(self) -> int:
        """Agent steps from one update to the next, of all environments together; scores do not depend on speed."""

    @property
    def drive_steps(self) -> int:
        """Agent steps after which all environments begin new episodes; 0 if they go on until their ends."""

    @property
    def num_rows(self) -> int:
        """The number of rows of experience that are stored now."""

    @property
    def actor(self) -> LearningAgent:
        """The agent, which acts with what is learned so far."""

    def config(self) -> dict[str, Any]:
        """Returns all values that the learner was built with, as plain data."""

    def description(self) -> str:
        """Returns one line for people: the size of the network and of the replay."""

    def driven(self, scene: Scene, actions: np.ndarray) -> np.ndarray:
        """Returns the actions `[B]` that are taken where the actor chose `actions`, before each step is observed."""

    def observe(self, experience: Experience) -> None:
        """Stores one step in all environments."""

    def update(self) -> dict[str, float]:
        """Learns from one batch; returns losses and other scalars by name."""

    def save(self, folder: pathlib.Path, provenance: Mapping[str, Any]) -> None:
        """Writes `agent.safetensors`, which acting needs, and all that `load` needs to go on exactly."""

    def load(self, folder: pathlib.Path) -> None:
        """Restores what `save` wrote.

        Where the replay was deleted, the learner fills it again before it goes on learning.
        """
