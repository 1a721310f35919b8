"""The base of the kinds of layouts, and the places where their doors may be.

`N` is the number of rows and of columns of a maze, `D` the number of its door slots.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import scipy


def door_slots(walls: np.ndarray) -> np.ndarray:
    """Returns the cells in which there may be a door between two rooms: `[D, 2]` int, open or not.

    Of such a cell, two opposite neighbours are free and the two others are walls. Each of the free ones has a free
    neighbour at its side: else it would be in the middle of a corridor of one cell. Rooms are the areas that are left
    when all these cells are closed, and a slot joins two of them.
    """
    free = ~walls
    wide, high = free.copy(), free.copy()  # free cells with a free neighbour to the left or right, or above or below
    wide[:, 1:-1] &= free[:, :-2] | free[:, 2:]
    high[1:-1] &= free[:-2] | free[2:]
    return _between_rooms(walls, _passages(walls, wide, high))


def lattice_door_slots(walls: np.ndarray) -> np.ndarray:
    """Returns the cells between two rooms on the odd lattice in which there may be a door: `[D, 2]` int, open or not.

    Of such a cell, exactly one of row and column is even. Cells of corridors count as rooms.
    """
    rows, columns = np.indices(walls.shape)
    return _between_rooms(walls, _passages(walls, ~walls, ~walls) & ((rows + columns) % 2 == 1))


def _passages(walls: np.ndarray, wide: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Returns the cells that can join two others, which lie above and below or left and right: `[N, N]` bool.

    Walls are on the two other sides. Cells of `wide` (`[N, N]` bool) may lie above and below, those of `high` left and
    right.
    """
    passages = np.zeros_like(walls)
    upright = walls[1:-1, :-2] & walls[1:-1, 2:] & wide[:-2, 1:-1] & wide[2:, 1:-1]
    level = walls[:-2, 1:-1] & walls[2:, 1:-1] & high[1:-1, :-2] & high[1:-1, 2:]
    passages[1:-1, 1:-1] = upright | level
    return passages


def _between_rooms(walls: np.ndarray, passages: np.ndarray) -> np.ndarray:
    """Returns the cells of `passages` whose two sides are in two rooms: `[D, 2]` int."""
    cells = np.argwhere(passages)
    first, second = rooms_beside(walls, cells)
    return cells[(first != second) & (first > 0) & (second > 0)]


def rooms_beside(walls: np.ndarray, slots: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns the numbers of the rooms on both sides of each of `slots` (`[D, 2]` int): `[D]` int, twice.

    Rooms are numbered from 1. The number is 0 where a slot leads into another slot.
    """
    closed = walls.copy()
    row, column = slots.T
    closed[row, column] = True
    rooms, _ = scipy.ndimage.label(~closed)
    first, second = rooms[row - 1, column], rooms[row + 1, column]
    level = (first == 0) | (second == 0)
    return np.where(level, rooms[row, column - 1], first), np.where(level, rooms[row, column + 1], second)


def largest_area(walls: np.ndarray) -> np.ndarray:
    """Returns `walls` (`[R, C]` bool) with all free cells closed but those of the largest connected area."""
    areas, _ = scipy.ndimage.label(~walls)
    sizes = np.bincount(areas.ravel())
    sizes[0] = 0
    return walls | (areas != np.argmax(sizes))  # all of them, if nothing is free


@dataclasses.dataclass(frozen=True)
class Kind:
    """A generator of layouts."""

    help: str  # what the layouts are, in a few words
    walls: Callable[[int, np.random.Generator], np.ndarray]  # [N, N] bool of a size N: legal walls of a maze
    door_slots: Callable[[np.ndarray], np.ndarray] = door_slots  # [D, 2] int: cells that may be doors in given walls
    smallest: int = 13  # cells a side
    odd: bool = False  # whether sizes must be odd
