"""Sources of the training loop's experience."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol

from mazebench.tasks.task import Task
from mazebench.training.experience import Collector, Experience
from mazebench.training.protocol import LearningAgent


class Source(Protocol):
    """Experience of B environments; a context manager that ends the processes it started."""

    def __enter__(self) -> Source: ...

    def __exit__(self, *exception: object) -> None: ...

    def collect(self, seed: int) -> Iterator[Sequence[tuple[int, Experience]]]:
        """Begins new trajectories everywhere, and yields what they bring, without end.

        Each piece of experience comes with the index of its first environment.
        """


class InProcessSource:
    """Steps all environments in this process, acting with the learner's current network."""

    def __init__(self, task_spec: Task, actor: LearningAgent, num_envs: int):
        self._collector = Collector(task_spec, num_envs, seed=0)
        self._actor = actor

    def collect(self, seed: int) -> Iterator[Sequence[tuple[int, Experience]]]:
        """Begins new trajectories everywhere and a new stream of exploration; yields steps in all environments."""
        num_envs = self._collector.num_envs
        self._collector.restart(seed)
        self._actor.explore_from(0, num_envs, seed)
        state = self._actor.initial_state(num_envs)
        while True:
            experience, state = self._collector.play(self._actor, state)
            yield [(0, experience)]

    def __enter__(self) -> InProcessSource:
        return self

    def __exit__(self, *exception: object) -> None:
        """Ends nothing: no process was started."""
