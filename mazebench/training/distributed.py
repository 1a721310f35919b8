"""Collecting on Ray: each actor plays in its share of the environments, and one learner learns from all of them.

This is Ape-X (Horgan et al. 2018) with one difference: the learner makes a fixed number of updates for each step that
arrives, so scores do not depend on how fast the actors are.
"""

from __future__ import annotations

import copy
import itertools
import logging
from collections.abc import Iterator, Sequence
from typing import Any

from mazebench.errors import InputError, RunError
from mazebench.tasks.task import Task
from mazebench.training.protocol import Learner
from mazebench.training.sources import Pieces, Player

try:
    import ray

    from mazebench.evaluation.cluster import connect
except ModuleNotFoundError as error:
    raise InputError("--workers needs Ray, which the extra [ray] brings (docs/start.md)") from error

_STEPS_PER_CALL = 16  # environment steps an actor takes before it answers
_CALLS_PER_PUBLISH = 4  # answers of an actor before it gets the newest network: 64 of its steps
_MAX_FAILURES = 20  # of actors, before the run gives up

_logger = logging.getLogger("mazebench.training")


class _Player(Player):
    """Plays in its share of the environments, in a process of its own."""

    def play_on(self, parameters: dict[str, Any] | None) -> Pieces:
        """Takes some steps, with new `parameters` if there are any."""
        if parameters is not None:
            self.set_parameters(parameters)
        return [piece for _ in range(_STEPS_PER_CALL) for piece in self.play()]


class RaySource:
    """Experience of Ray actors in the order in which it arrives; an actor that dies is replaced."""

    def __init__(self, tasks: Sequence[Task], learner: Learner, workers: int, address: str | None):
        """Connects to the cluster at `address`, None starts a local one; `collect` starts the actors.

        Raises:
          InputError: if the cluster can't be reached, or has fewer CPUs than `workers`, or the learner has fewer
            environments.
        """
        if workers > learner.num_envs:
            raise InputError(f"expected at most {learner.num_envs} workers, one an environment, found {workers}")
        self._players: list[Any] = []
        self._started = not ray.is_initialized()
        if self._started:
            connect(address or "local")
        num_cpus = int(ray.cluster_resources().get("CPU", 0))
        if num_cpus < workers:
            self.__exit__()
            raise InputError(f"expected at most {num_cpus} workers, one a CPU of the cluster, found {workers}")
        self._learner, self._tasks = learner, tasks
        bounds = [worker * learner.num_envs // workers for worker in range(workers + 1)]
        self._shares = list(itertools.pairwise(bounds))
        self._players = [None] * workers
        self._calls: dict[Any, int] = {}  # the worker's index, by the awaited answer
        self._num_answers = [0] * workers
        self._num_failures = self._seed = 0
        self._longest: int | None = None  # distance of goals, if it is limited

    def collect(self, seed: int) -> Iterator[Pieces]:
        """Begins new trajectories in all actors, and yields the steps of one actor after another."""
        self._seed = seed
        self._calls = {}  # answers still awaited are of older trajectories
        for worker in range(len(self._players)):
            if self._players[worker] is None:
                self._start(worker)
            else:
                self._begin(worker)
        while True:
            yield self._next_answer()

    def _next_answer(self) -> Pieces:
        """Waits for the steps of one actor, and lets that actor go on; none where the actor died and was replaced."""
        done, _ = ray.wait(list(self._calls), num_returns=1)
        worker = self._calls.pop(done[0])
        try:
            pieces: Pieces = ray.get(done[0])
        except ray.exceptions.RayActorError as error:
            self._replace(worker, error)
            return []
        self._num_answers[worker] += 1
        self._play(worker, publish=self._num_answers[worker] % _CALLS_PER_PUBLISH == 0)
        return pieces

    def limit_distances(self, longest: int) -> None:
        """Sends the agent to goals at most so many cells away from now on."""
        self._longest = longest
        for player in self._players:
            if player is not None:
                player.limit_distances.remote(longest)

    def _start(self, worker: int) -> None:
        player = ray.remote(num_cpus=1)(_Player)
        actor = copy.deepcopy(self._learner.actor)
        num_envs = self._learner.num_envs
        self._players[worker] = player.remote(self._tasks, actor, num_envs, self._shares[worker], num_threads=1)
        if self._longest is not None:
            self._players[worker].limit_distances.remote(self._longest)
        self._begin(worker)

    def _begin(self, worker: int) -> None:
        self._players[worker].restart.remote(self._seed + worker + self._num_failures * len(self._players))
        self._play(worker, publish=True)

    def _play(self, worker: int, publish: bool) -> None:
        parameters = self._learner.actor.parameters() if publish else None
        self._calls[self._players[worker].play_on.remote(parameters)] = worker

    def _replace(self, worker: int, error: Exception) -> None:
        self._num_failures += 1
        if self._num_failures > _MAX_FAILURES:
            raise RunError(f"{_MAX_FAILURES} Ray actors died, the last of: {str(error).splitlines()[0]}") from error
        _logger.warning("Ray actor %d died; it is replaced", worker)
        self._start(worker)

    def __enter__(self) -> RaySource:
        return self

    def __exit__(self, *exception: object) -> None:
        for player in self._players:
            if player is not None:
                ray.kill(player)
        if self._started:
            ray.shutdown()
