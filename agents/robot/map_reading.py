"""Probabilities of walls, start and goal in each cell, as read from a context before the body moves.

A map with a pixel for each cell shows the cells. One with more pixels is registered with the maze as a drawing
(`drawn_map`). Planes that are zero tell nothing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mazebench.tasks.context import GLOBAL_MAP, GOAL, START

from .cells import marked_cell
from .drawn_map import register, with_border

_ERROR = 0.1  # probability that a cell is shown wrong, before anything was seen
_UNKNOWN = 0.2  # probability of a wall where no map is shown; less than walls' share, so that unseen ways are tried


class MapReading(NamedTuple):
    """Three distributions over the cells of a maze of N x N cells."""

    walls: np.ndarray  # [N, N] float, the probability that a cell is a wall; 1 at the border only
    start: np.ndarray  # [N, N] float, the probability that a cell is the start; sums to 1
    goal: np.ndarray  # [N, N] float, the probability that a cell is the goal; sums to 1


def read_map(context: np.ndarray, size: int) -> MapReading:
    """Returns what a context `[4, M, M]` tells of a maze of `size` cells a side, at most M."""
    picture, planes = context[GLOBAL_MAP], context[[START, GOAL]].astype(np.float64)
    if len(picture) > size and picture.any():
        registration = register(picture, size)
        walls = registration.walls
        possible = 1 - walls
        marks = [registration.marked(marked_cell(plane)) if plane.any() else 1.0 for plane in planes]
    else:
        walls = np.full((size, size), _UNKNOWN)
        if picture.any():
            walls = _ERROR + (1 - 2 * _ERROR) * np.clip(picture.astype(np.float64), 0, 1)
        walls = with_border(walls)
        # Cell (r, c) is marked at (r M // N, c M // N). Marks are right even where the map shows a wall.
        possible = (walls < 1).astype(np.float64)
        pixels = np.ix_(*[np.arange(size) * len(picture) // size] * 2)
        marks = [plane[pixels] if plane.any() else 1.0 for plane in planes]

    # Without any weights, free cells are equally likely.
    weights = [mark * possible for mark in marks]
    start, goal = (each if each.any() else 1 - walls for each in weights)
    return MapReading(walls, start / start.sum(), goal / goal.sum())
