"""What a context tells of the maze before the body moves: where walls, start and goal probably are.

A map with a pixel for each cell shows the cells. One with fewer pixels shows shares of wall. One with more pixels is
registered with the maze as a drawing (`drawn_map`). Planes that are zero tell nothing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mazebench.maps.maze import Cell
from mazebench.tasks.context import GLOBAL_MAP, GOAL, LOCAL_MAP, START

from .body import Point
from .cells import marked_cell, nearest_cell
from .drawn_map import register, with_border

_ERROR = 0.1  # probability that a cell is shown wrong, before anything was seen
_UNKNOWN = 0.2  # probability of a wall where no map is shown; less than walls' share, so that unseen ways are tried


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
    if context.shape[-1] > size and context[GLOBAL_MAP].any():
        return _read_drawing(context, size, start)

    # The shares of wall in pixels, as the probabilities of walls in cells.
    walls = np.full((size, size), _UNKNOWN)
    if context[GLOBAL_MAP].any():
        shares = _overlaps(size, context.shape[-1])
        shares /= shares.sum(axis=0)
        walls = _believed(shares.T @ context[GLOBAL_MAP].astype(np.float64) @ shares)
    if start is not None and context.shape[-1] < size and context[LOCAL_MAP].any():
        walls = _with_cells_around(walls, context[LOCAL_MAP], start)
    walls = with_border(walls)

    # Cell (r, c) is marked at (r M // N, c M // N). Marks are right even where the map shows a wall.
    pixels = np.ix_(*[np.arange(size) * context.shape[-1] // size] * 2)
    inner = (walls < 1).astype(np.float64)
    return _reading(walls, start, *(_marks(context[plane])[pixels] * inner for plane in (START, GOAL)))


def _overlaps(size: int, num_pixels: int) -> np.ndarray:
    """Returns `[M, N]` float: the share of each cell in each pixel along one axis; rows sum to 1."""
    edges, cells = np.arange(num_pixels + 1) * size / num_pixels, np.arange(size)
    overlaps = np.minimum(edges[1:, None], cells + 1) - np.maximum(edges[:-1, None], cells)
    return np.maximum(overlaps, 0.0) * num_pixels / size


def _with_cells_around(walls: np.ndarray, crop: np.ndarray, start: Cell) -> np.ndarray:
    """Returns `walls` with the cells of the local map `crop` `[M, M]`, whose middle is the start."""
    size, first = len(walls), [index - len(crop) // 2 for index in start]
    (top, bottom), (left, right) = ((max(0, index), min(size, index + len(crop))) for index in first)
    cells = crop[top - first[0] : bottom - first[0], left - first[1] : right - first[1]]
    walls[top:bottom, left:right] = _believed(cells)
    return walls


def _believed(shown: np.ndarray) -> np.ndarray:
    """Returns the probabilities of walls where shares of wall in [0, 1] are shown, of which some are wrong."""
    return _ERROR + (1 - 2 * _ERROR) * np.clip(shown, 0, 1)


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
