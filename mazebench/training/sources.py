"""Where experience comes from: this process, or Ray actors on many."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Protocol

from mazebench.agent import ExploringAgent
from mazebench.tasks.spec import TaskSpec
from mazebench.training.experience import Collector, Experience

if TYPE_CHECKING:
    from mazebench.agent import LearningAgent
    from mazebench.training.loop import TrainOptions


class Source(Protocol):
    """Gives experience of environments that are numbered through; a context manager that ends what it started."""

    def __enter__(self) -> Source: ...

    def __exit__(self, *exception: object) -> None: ...

    def restart(self, seed: int) -> None:
        """Begins new trajectories everywhere."""

    def collect(self) -> Iterator[tuple[int, Experience]]:
        """Yields what came next, each with the number of its first environment."""


class InProcessSource:
    """All environments in this process, a step at a time, acted in by the learner's own, ever newest, network."""

    def __init__(self, task_spec: TaskSpec, actor: ExploringAgent, num_envs: int):
        self._collector = Collector(task_spec, num_envs, seed=0)
        self._actor = actor

    def restart(self, seed: int) -> None:
        """Begins new trajectories everywhere, and a new stream of exploration."""
        self._collector.restart(seed)
        self._actor.explore_from(0, self._collector.num_envs, seed)
        self._state: Any = self._actor.initial_state(self._collector.num_envs)

    def collect(self) -> Iterator[tuple[int, Experience]]:
        """Takes one step in each environment."""
        experience, self._state = self._collector.play(self._actor, self._state)
        yield 0, experience

    def __enter__(self) -> InProcessSource:
        return self

    def __exit__(self, *exception: object) -> None:
        """Nothing to end."""


def ray_source(options: TrainOptions, task_spec: TaskSpec, learner: LearningAgent) -> Source:
    """Actors on Ray, `options.workers` of them, each with its share of the environments.

    Raises:
      InputError: if Ray is not installed or the cluster can't be reached.
    """
    from mazebench.training.distributed import RaySource

    return RaySource(options, task_spec, learner)
