"""The evaluation that accompanies a training run, in mazes that it doesn't train in unless they are one's own."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from mazebench.agent import Agent
from mazebench.errors import InputError
from mazebench.evaluation.chunk import run_trials
from mazebench.maps.drawn import FreshMazes
from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze
from mazebench.tasks.arena import arena_of
from mazebench.tasks.task import Task, resolve
from mazebench.tasks.task_options import SPARSE
from mazebench.tasks.tracks import distance_of
from mazebench.tasks.trials import draw_trials

_SEED = 20_000  # of mazes that are drawn like the benchmark's, and in none of its splits
_DISTANCES = (2, 4, 6, 8, 10)  # of a task without a track, unless others are asked for
_EPISODES = 2  # for each maze and distance
_MAX_DRAWS = 100  # of a maze in which the task can be played


class HeldOutEvaluation:
    """Episodes in `num_mazes` new mazes of the size and kinds of `task`'s, with its track, perturbations and sensors.

    Mazes of one's own have no kind, and no others are like them: there, they are new episodes in the same mazes.
    """

    def __init__(self, task: Task, num_mazes: int, distances: Sequence[int] = ()):
        """Draws the mazes; the goals are at five of the `distances`, or of those of the task's track."""
        mazes = task.mazes
        all_kinds = mazes.kinds if isinstance(mazes, FreshMazes) else (maze.kind for maze in mazes if maze.kind)
        kinds = tuple(dict.fromkeys(all_kinds)) if task.arena.shown is None else ()  # each once; own mazes have none
        if not distances:
            distances = _DISTANCES if task.options.track is None and kinds else task.options.distances or ()
        spread = np.linspace(min(distances), max(distances), len(_DISTANCES)).round().astype(int).tolist()
        self._distances = tuple(sorted({min(distances, key=lambda each: abs(each - wanted)) for wanted in spread}))
        plain = task.replace(distances=self._distances, num_goals=1, pairs="random", reward=SPARSE)
        streams = np.random.SeedSequence([_SEED, task.size]).spawn(num_mazes)
        drawn = [
            _draw_maze(plain, kinds[index % len(kinds)], f"held-out-{index}", stream)
            for index, stream in enumerate(streams if kinds else ())
        ]
        self.task = _in_mazes(plain, drawn) if drawn else plain
        self.trials = draw_trials(self.task, _EPISODES)

    def success_rates(self, agent: Agent, progress: Callable[[int, int], None]) -> dict[int, float]:
        """Returns the success rate of the agent, which acts greedily, by distance: in cells, on a track in metres.

        `progress` is called with how many episodes have ended, and of how many.
        """
        reached: dict[int, list[bool]] = {distance: [] for distance in self._distances}
        num_ended = 0
        for results in run_trials(agent, self.task, dict(enumerate(self.trials)), len(self.trials)):
            for result in results:
                cells = self.trials[result.number].distance
                reached[distance_of(cells, self.task.cell_size, self.task.options.track)].append(result.success)
            num_ended += len(results)
            progress(num_ended, len(self.trials))
        return {distance: float(np.mean(successes)) for distance, successes in reached.items()}


def _draw_maze(task: Task, kind: str, name: str, stream: np.random.SeedSequence) -> Maze:
    """Returns the first maze of `stream` in which `task` can be played."""
    rng = np.random.default_rng(stream)
    for draw in range(_MAX_DRAWS):
        maze = generate(kind, task.size, rng, name)
        try:
            _in_mazes(task, [maze])
        except InputError:
            if draw == _MAX_DRAWS - 1:
                raise
        else:
            break
    return maze


def _in_mazes(task: Task, mazes: Sequence[Maze]) -> Task:
    """Returns a task in other mazes, or raises `InputError` if it can't be played in one of them."""
    return resolve(task.options, arena=arena_of(task.options, tuple(mazes)))
