"""What a context tells of the maze before the body moves: where walls, start and goal probably are.

A map with a pixel for each cell shows the cells (`cell_map`). One with fewer pixels is explained by doors that are open
or closed (`coarse_map`). One with more pixels is registered with the maze as a drawing (`drawn_map`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mazebench.maps.maze import Cell
from mazebench.tasks.context import GLOBAL_MAP, GOAL, LOCAL_MAP, START

from ..robot.body import Point
from ..robot.cells import marked_cell, nearest_cell
from .cell_map import wall_probability
from .coarse_map import read_coarse_map
from .drawn_map import register


class MapReading(NamedTuple):
    """Three distributions over the cells of a maze of N x N cells."""

    walls: np.ndarray  # [N, N] float, the probability that a cell is a wall; 1 at the border only
    start: np.ndarray  # [N, N] float, the probability that a cell is the start; sums to 1
    goal: np.ndarray  # [N, N] float, the probability that a cell is the goal; sums to 1


def read_map(context: np.ndarray, size: int, start_point: Point | None = None) -> MapReading:
    """Returns what a context `[4, M, M]` tells of a maze of `size` cells a side.

    `start_point` is a point (x, y) in the start cell, in cells, if one is known.
    """
    start = None if start_point is None else nearest_cell(*start_point, size)
    if context.shape[-1] > size:
        return _read_drawing(context, size, start)
    if context.shape[-1] < size:
        return _read_coarse(context, size, start)
    walls = wall_probability(context[GLOBAL_MAP] > 0.5)
    # Marks are right even where the map shows a wall.
    inner = (walls < 1).astype(np.float64)
    return _reading(walls, start, *(_marks(context[plane]) * inner for plane in (START, GOAL)))


def _read_coarse(context: np.ndarray, size: int, start: Cell | None) -> MapReading:
    """Reads a map with fewer pixels than cells, on which cell (r, c) is marked at (r M // N, c M // N)."""
    picture = context[GLOBAL_MAP].astype(np.float64)
    known = np.full((size, size), np.nan) if start is None else _cells_around(context[LOCAL_MAP], size, start)
    walls = read_coarse_map(picture, size, known)
    pixels = np.ix_(*[np.arange(size) * context.shape[-1] // size] * 2)
    return _reading(walls, start, *(_marks(context[plane])[pixels] * (1 - walls) for plane in (START, GOAL)))


def _cells_around(crop: np.ndarray, size: int, start: Cell) -> np.ndarray:
    """Returns `[N, N]` float: the cells of the local map `[M, M]`, whose middle is the start; NaN where it has none."""
    known = np.full((size, size), np.nan)
    first = [index - len(crop) // 2 for index in start]
    (top, bottom), (left, right) = ((max(0, index), min(size, index + len(crop))) for index in first)
    known[top:bottom, left:right] = crop[top - first[0] : bottom - first[0], left - first[1] : right - first[1]]
    return known


def _read_drawing(context: np.ndarray, size: int, start: Cell | None) -> MapReading:
    """Reads a map with more pixels than cells; the start ties its pixel to its cell if both are known."""
    anchor = None
    if start is not None and context[START].any():
        anchor = (marked_cell(context[START]), np.array(start) + 0.5)
    registration = register(context[GLOBAL_MAP], size, anchor)
    marks = []
    for plane in context[[START, GOAL]]:
        mark = registration.marked(marked_cell(plane)) if plane.any() else 1.0
        marks.append(mark * (1 - registration.walls))
    return _reading(registration.walls, start, *marks)


def _marks(plane: np.ndarray) -> np.ndarray:
    """Returns `[M, M]` float: 1 where a mark may be, which is everywhere if there is none."""
    return plane.astype(np.float64) if plane.any() else np.ones(plane.shape)


def _reading(walls: np.ndarray, start: Cell | None, start_weights: np.ndarray, goal_weights: np.ndarray) -> MapReading:
    """Returns a reading with distributions that are proportional to weights `[N, N]`, but for a start that is known."""
    if start is not None:
        start_weights = np.zeros(walls.shape)
        start_weights[start] = 1.0
    return MapReading(walls, _normalised(start_weights, walls), _normalised(goal_weights, walls))


def _normalised(weights: np.ndarray, walls: np.ndarray) -> np.ndarray:
    """Returns `[N, N]` float that sum to 1; without any weights, free cells are equally likely."""
    weights = weights if weights.any() else 1 - walls
    return weights / weights.sum()
