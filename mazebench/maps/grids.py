"""Grids of any shape as mazes, which are square.

`R` and `C` are the numbers of rows and columns of a grid.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from mazebench.errors import remark
from mazebench.maps.maze import Maze, require_closed_border


def square_maze(walls: np.ndarray, name: str, cell_size: float = 1.0) -> Maze:
    """Returns the maze with `walls` (`[R, C]` bool), padded to a square with wall on the right or at the bottom.

    A cell keeps its row and column. A `Remark` says what was padded.

    Raises:
      MazeError: if it is not a legal maze.
    """
    if walls.ndim != 2 or walls.shape[0] == walls.shape[1]:
        return Maze(walls, name, cell_size)
    require_closed_border(walls, name)
    maze = Maze(pad_to_square(walls), name, cell_size)
    rows, columns = walls.shape
    where = "on the right" if rows > columns else "at the bottom"
    line = f"{name}: {rows} x {columns} cells, padded with wall {where} to {maze.size} x {maze.size}"
    remark(line)
    return maze


def pad_to_square(walls: np.ndarray) -> np.ndarray:
    """Returns `walls` (`[R, C]` bool) with wall on the right or at the bottom: `[N, N]` bool."""
    rows, columns = walls.shape
    size = max(rows, columns)
    return np.pad(walls, ((0, size - rows), (0, size - columns)), constant_values=True)


def largest_area(walls: np.ndarray) -> np.ndarray:
    """Returns `walls` (`[R, C]` bool) with all free cells closed but those of the largest connected area."""
    areas, _ = ndimage.label(~walls)
    sizes = np.bincount(areas.ravel())
    sizes[0] = 0
    return walls | (areas != np.argmax(sizes))  # all of them, if nothing is free
