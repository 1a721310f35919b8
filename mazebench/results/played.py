"""The task and the shown maps of a finished evaluation, computed from its options and seeds.

`N` is the number of cells on a side of the mazes, `M` the number of pixels on a side of the agent's maps.
"""

from __future__ import annotations

import hashlib
from typing import NamedTuple

import numpy as np

from mazebench.errors import InputError
from mazebench.maps.benchmark import manifest_hash
from mazebench.options import from_names, options_of
from mazebench.results.records import Summary
from mazebench.tasks.build import build_task
from mazebench.tasks.context import GLOBAL_MAP, GOAL, START
from mazebench.tasks.episode import Episode
from mazebench.tasks.route import plan_route
from mazebench.tasks.shown_map import leg_context, show_map
from mazebench.tasks.spec import TaskSpec
from mazebench.tasks.task_options import EnvironmentOptions

# Options that change nothing of what is shown. A summary has the chosen values, which options may not allow.
_UNSEEN = ("distances", "time_limit")


class Shown(NamedTuple):
    """The map that the agent was shown in an episode, and the cells that it was sent to."""

    walls: np.ndarray  # [N, N] bool where the pixels are the maze's cells; else [M, M] uint8, 255 is wall
    start: int  # pixel of the map as row * side + column; -1 if it is not marked
    goal: int  # as `start`
    landmarks: list[int]  # cells of the maze as row * N + column, in order, without the goal

    @property
    def are_cells(self) -> bool:
        """True if the pixels are the maze's cells."""
        return self.walls.dtype == bool


def task_of(summary: Summary) -> TaskSpec:
    """Returns the task of an evaluation, with the default distances and time limit.

    Raises:
      InputError: if this version of the benchmark has no such task, or the mazes are gone or were changed.
    """
    provenance = summary.provenance
    installed, found = manifest_hash(summary.benchmark), provenance.benchmark_manifest_sha256 or "unknown"
    if installed != found:
        raise InputError(
            f"expected results of benchmark {summary.benchmark!r}, manifest {installed[:8]}, found manifest {found[:8]}"
        )
    names = set(options_of(EnvironmentOptions)) - set(_UNSEEN)
    told = provenance.options.model_dump() | {"context_size": provenance.context_size}
    chosen = from_names(EnvironmentOptions, {name: value for name, value in told.items() if name in names})
    task = build_task(chosen.task, chosen.maze_options, chosen.variants)
    if mazes_hash(task) != provenance.mazes_sha256:
        raise InputError("expected the mazes that were played, found others")
    return task


def mazes_hash(task: TaskSpec) -> str:
    """Returns a SHA-256 of the mazes; 1 m, the width of the benchmark's cells, does not change it."""
    scale = "" if task.cell_size == 1 else repr(task.cell_size)
    walls = b"".join(maze.walls.tobytes() for maze in task.fixed_mazes)
    return hashlib.sha256(walls + scale.encode("ascii")).hexdigest()


def shown_of(task: TaskSpec, episode: Episode) -> Shown:
    """Returns what the agent was shown in an episode."""
    shown = show_map(task, episode)
    cells = plan_route(task, episode, shown).cells[1:-1]
    landmarks = [row * task.size + column for row, column in cells]
    context = leg_context(task, shown, episode.start, episode.goal)
    are_cells = shown.drawing is None and task.context_size == task.size
    walls = shown.walls if are_cells else np.rint(context[GLOBAL_MAP] * 255).astype(np.uint8)
    start, goal = (int(plane.argmax()) if plane.any() else -1 for plane in context[[START, GOAL]])
    return Shown(walls, start, goal, landmarks)
