"""Sources of the training loop's experience."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Protocol

from mazebench.tasks.task import Task
from mazebench.training.experience import Collector, Experience
from mazebench.training.protocol import LearningAgent

_SEEDS_APART = 1_000_003  # seeds of the environments of one task and of the next

Pieces = list[tuple[int, Experience]]  # of experience, each with the index of its first environment


class Source(Protocol):
    """Experience of B environments; a context manager that ends the processes it started."""

    def __enter__(self) -> Source: ...

    def __exit__(self, *exception: object) -> None: ...

    def collect(self, seed: int) -> Iterator[Pieces]:
        """Begins new trajectories everywhere, and yields what they bring, without end."""

    def limit_distances(self, longest: int) -> None:
        """Sends the agent to goals at most so many cells away from now on."""


class Player:
    """Plays in some of a learner's environments, of which each task has an equal share."""

    def __init__(
        self,
        tasks: Sequence[Task],
        actor: LearningAgent,
        num_envs: int,
        own: tuple[int, int] | None = None,
        num_threads: int = 0,
    ):
        """Plays in the environments from the first of `own` up to the second, by default in all `num_envs`."""
        first, end = own or (0, num_envs)
        bounds = [number * num_envs // len(tasks) for number in range(len(tasks) + 1)]
        self._parts = []
        for task, begin, following in zip(tasks, bounds, bounds[1:], strict=False):
            begin, following = max(begin, first), min(following, end)
            if begin < following:
                collector = Collector(task, following - begin, seed=0, num_threads=num_threads)
                self._parts.append((begin, collector, actor.in_task(task)))
        self._actor = actor
        self._states: list[Any] = []

    def restart(self, seed: int) -> None:
        """Begins new trajectories everywhere, and a new stream of exploration."""
        self._states = []
        for number, (first, collector, actor) in enumerate(self._parts):
            collector.restart(seed + number * _SEEDS_APART)
            actor.explore_from(first, collector.num_envs, seed)
            self._states.append(actor.initial_state(collector.num_envs))

    def limit_distances(self, longest: int) -> None:
        """Sends the agent to goals at most so many cells away from now on."""
        for _, collector, _ in self._parts:
            collector.limit_distances(longest)

    def play(self) -> Pieces:
        """Takes one step everywhere."""
        pieces = []
        for number, (first, collector, actor) in enumerate(self._parts):
            actions, state = actor.act(collector.inputs, self._states[number], explore=True)
            pieces.append((first, collector.step(actions, actor.notes(state))))
            self._states[number] = state
        return pieces

    def set_parameters(self, parameters: dict[str, Any]) -> None:
        """Acts by these from now on."""
        self._actor.set_parameters(parameters)


class InProcessSource:
    """Steps all environments in this process, acting with the learner's current network."""

    def __init__(self, tasks: Sequence[Task], actor: LearningAgent, num_envs: int):
        self._player = Player(tasks, actor, num_envs)

    def limit_distances(self, longest: int) -> None:
        """Sends the agent to goals at most so many cells away from now on."""
        self._player.limit_distances(longest)

    def collect(self, seed: int) -> Iterator[Pieces]:
        """Begins new trajectories everywhere and a new stream of exploration; yields steps in all environments."""
        self._player.restart(seed)
        while True:
            yield self._player.play()

    def __enter__(self) -> InProcessSource:
        return self

    def __exit__(self, *exception: object) -> None:
        """Ends nothing: no process was started."""
