"""Cells of a map: the one that a point is in, and those that a context marks."""

from __future__ import annotations

import numpy as np

from mazebench.maps.maze import Cell, cell_of_point
from mazebench.tasks.context import GLOBAL_MAP, START


def nearest_cell(x: float, y: float, size: int) -> Cell:
    """Returns the cell of a point, or the nearest one if the point lies outside of the map."""
    row, column = cell_of_point(x, y, size)
    return min(max(row, 0), size - 1), min(max(column, 0), size - 1)


def marked_cell(plane: np.ndarray) -> Cell:
    """Returns the marked cell of a one-hot plane `[M, M]`."""
    row, column = divmod(int(np.argmax(plane)), plane.shape[1])
    return row, column


def start_cell(context: np.ndarray) -> Cell:
    """Returns the start on the map of a context `[4, M, M]`.

    It is the marked cell. If none is marked, it is the free cell nearest to the middle of the map, the first one in
    reading order: of all guesses, the middle is the nearest to the start on average.
    """
    if context[START].any():
        return marked_cell(context[START])
    offset = (np.arange(len(context[START])) - (len(context[START]) - 1) / 2) ** 2
    distance = offset[:, None] + offset
    walls = context[GLOBAL_MAP] > 0.5
    return marked_cell(-distance - distance.max() * 2 * walls)
