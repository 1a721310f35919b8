"""Mazes in which one can say by hand where a body gets to."""

from __future__ import annotations

import numpy as np

from mazebench.maps.maze import Maze


def field(size: int) -> Maze:
    """Returns a maze without walls but for its border."""
    return Maze(np.pad(np.zeros((size - 2, size - 2), dtype=bool), 1, constant_values=True), "field")


def corridor() -> Maze:
    """Returns 7 free cells in a row, from (1, 1) to (1, 7) of 9 x 9."""
    walls = np.ones((9, 9), dtype=bool)
    walls[1, 1:8] = False
    return Maze(walls, "corridor")
