"""Tasks on maps of one's own, or with a start or a goal of one's own: which distances and time limit fit them."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from mazebench.maps.maze import Maze
from mazebench.tasks.options import EVAL_DISTANCES, TIME_LIMIT
from mazebench.tasks.spec import TaskSpec
from mazebench.tasks.tracks import TRACKS

# Of the diameter of a large maze. Few pairs of cells are farther apart, so that they would be long to find.
_FARTHEST_SHARE = 0.9
# Agent steps. A metre takes 2 at the top speed, and a quarter turn in each cell 4; the track `far` has as many.
_STEPS_A_METRE, _STEPS_A_CELL, _SPARE_STEPS = 2, 4, 50


def own_task(
    mazes: tuple[Maze, ...], *, distances: tuple[int, ...] | None = None, time_limit: int = 0, **options: Any
) -> TaskSpec:
    """Returns a task in `mazes`; the distances and the time limit fit them, unless they are given.

    `options` are others of `TaskSpec`.

    Raises:
      InputError: if an option is not allowed, or the mazes do not fit it.
    """
    spec = TaskSpec(mazes=mazes, distances=(1,) if distances is None else distances, time_limit=time_limit, **options)
    if distances is None:
        spec = dataclasses.replace(spec, distances=fitting_distances(spec))
    if time_limit or spec.track is not None:  # which has its own
        return spec
    cells = spec.landmark_distance if spec.task == "hierarchical" else max(spec.distances)
    return dataclasses.replace(spec, time_limit=fitting_time_limit(cells, spec.cell_size))


def fitting_distances(spec: TaskSpec) -> tuple[int, ...]:
    """Returns the distances in cells of the given ends; else at most 15, evenly spaced up to what all mazes have.

    Of a track, they are those of its own distances that all mazes have; all of its own, if none has any.
    """
    if spec.task == "hierarchical" or spec.ends_given == 2:
        return tuple(sorted({spec.farthest(maze) for maze in spec.mazes}))
    farthest, count = min(map(spec.farthest, spec.mazes)), len(EVAL_DISTANCES)
    if spec.track is not None:
        own = TRACKS[spec.track].distances(min(spec.level))
        return tuple(distance for distance in own if distance <= farthest) or own
    if farthest > count:
        farthest = max(count, int(_FARTHEST_SHARE * farthest))
    count = min(count, farthest)
    return tuple(round(farthest * number / count) for number in range(1, count + 1))


def fitting_time_limit(num_cells: int, cell_size: float) -> int:
    """Returns the agent steps in which a goal `num_cells` away is reached with some to spare, at least 100."""
    return max(TIME_LIMIT, math.ceil((_STEPS_A_METRE * cell_size + _STEPS_A_CELL) * num_cells) + _SPARE_STEPS)
