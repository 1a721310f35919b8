"""The mazes and the shown maps of a finished evaluation, computed from its task and seeds.

`N` is the number of cells on a side of the mazes, `M` the number of pixels on a side of the agent's maps.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mazebench.errors import InputError
from mazebench.maps.benchmark import manifest_hash
from mazebench.maps.maze import Cell
from mazebench.results.records import Summary
from mazebench.tasks.context import GLOBAL_MAP, GOAL, START
from mazebench.tasks.episode import Episode
from mazebench.tasks.route import plan_route
from mazebench.tasks.shown_map import leg_context, show_map
from mazebench.tasks.task import Task, resolve


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


def played_task(summary: Summary) -> Task:
    """Returns the task of an evaluation, whose mazes are there as they were played.

    Raises:
      InputError: if this version of the benchmark has others, or the mazes are gone or were changed.
    """
    provenance = summary.provenance
    installed, found = manifest_hash(summary.benchmark), provenance.benchmark_manifest_sha256
    if installed != found:
        raise InputError(
            f"expected results of benchmark {summary.benchmark!r}, manifest {installed[:8]}, found manifest {found[:8]}"
        )
    task = resolve(summary.task)
    if mazes_hash(task) != provenance.mazes_sha256:
        raise InputError("expected the mazes that were played, found others")
    return task


def mazes_hash(task: Task) -> str:
    """Returns a SHA-256 of the mazes, of fresh ones of the first, and of older maps of them.

    1 m, the width of the benchmark's cells, is left out.
    """
    scale = "" if task.cell_size == 1 else repr(task.cell_size)
    mazes = (task.mazes[0],) if task.options.fresh else task.arena.fixed_mazes
    walls = b"".join(maze.walls.tobytes() for maze in mazes)
    older = b"".join(each.walls.tobytes() for each in task.arena.shown or ())
    return hashlib.sha256(walls + scale.encode("ascii") + older).hexdigest()


def shown_of(task: Task, episode: Episode, ends: Sequence[Cell] | None = None) -> Shown:
    """Returns what the agent was shown in an episode, or in the leg between two `ends` of it."""
    shown = show_map(task, episode)
    cells = plan_route(task, episode, shown).cells[1:-1]
    landmarks = [row * task.size + column for row, column in cells]
    context = leg_context(task, shown, *(ends or (episode.start, episode.goal)))
    are_cells = shown.drawing is None and task.context_size == task.size
    walls = shown.walls if are_cells else np.rint(context[GLOBAL_MAP] * 255).astype(np.uint8)
    start, goal = (int(plane.argmax()) if plane.any() else -1 for plane in context[[START, GOAL]])
    return Shown(walls, start, goal, landmarks)
