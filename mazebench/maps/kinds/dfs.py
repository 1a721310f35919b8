"""Mazes of corridors, made by depth-first search."""

from __future__ import annotations

import numpy as np

from mazebench.maps.kinds.kind import Kind, lattice_door_slots
from mazebench.maps.maze import Cell

# Share of the walls between two corridors that are opened. With it, over 90 % of 13 x 13 mazes have 3 to 6 landmarks at
# distance 5 from corner to corner, as in the paper (docs/layouts.md).
DFS_OPENINGS = 0.10


def dfs_walls(size: int, rng: np.random.Generator, openings: float = DFS_OPENINGS) -> np.ndarray:
    """Returns the walls of a maze of corridors: `[size, size]` bool.

    Randomised depth-first search on the cells with odd row and column joins them to a tree. Then each wall between two
    of them is opened with probability `openings`.
    """
    walls = np.ones((size, size), dtype=bool)
    row, column = (2 * rng.integers(size // 2, size=2) + 1).tolist()
    carve_corridors(walls, (row, column), rng)
    return walls & ~(between_lattice_cells(walls) & (rng.random(walls.shape) < openings))


def carve_corridors(walls: np.ndarray, start: Cell, rng: np.random.Generator) -> None:
    """Joins the walled cells of the odd lattice that can be reached from `start` over others to a tree, in place."""
    # As a set of pairs: looking up single cells in an array takes three times as long.
    walled = set(map(tuple, (2 * np.argwhere(walls[1::2, 1::2]) + 1).tolist())) - {start}
    opened, stack = [start], [start]
    while stack:
        row, column = stack[-1]
        neighbours = ((row - 2, column), (row + 2, column), (row, column - 2), (row, column + 2))
        closed = [cell for cell in neighbours if cell in walled]
        if not closed:
            stack.pop()
            continue
        cell = closed[rng.integers(len(closed)) if len(closed) > 1 else 0]
        walled.remove(cell)
        opened += [cell, ((row + cell[0]) // 2, (column + cell[1]) // 2)]
        stack.append(cell)
    walls[tuple(np.transpose(opened))] = False


def between_lattice_cells(walls: np.ndarray) -> np.ndarray:
    """Returns the walls between two neighbouring cells of the odd lattice."""
    between = np.zeros_like(walls)
    between[1:-1:2, 2:-1:2] = between[2:-1:2, 1:-1:2] = True
    return between & walls


DFS = Kind("corridors without rooms, by depth-first search", dfs_walls, lattice_door_slots, smallest=5, odd=True)
