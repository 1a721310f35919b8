"""Passages of any building: what can be closed in it, and where a door can be opened.

A passage is a straight strip of cells, all free (open) or all wall (walled), whose two sides are near each other
through it and far by any other way. Lengths are compared in metres, and ways run along the sides of cells, so that a
building has the same passages whether it is drawn with cells of 1 m or with four of 0.5 m for each.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np
from scipy import ndimage

WIDEST = 2.4  # m, of an open passage
THICKEST = 1.0  # m, of a wall in which a door can be opened; of a longer open passage, so much is closed
DOOR = 0.9  # m, the width of a door that is opened
DETOUR = 6.0  # m, the least length of any other way between the two sides
_TOLERANCE = 1e-6  # cells


class Passage(NamedTuple):
    """A strip of cells: its first row and column, and the end of its rows and columns."""

    top: int
    left: int
    bottom: int
    right: int
    is_open: bool

    def cells(self, margin: int = 0) -> tuple[slice, slice]:
        """Returns the rows and columns, with a margin of some cells."""
        return slice(self.top - margin, self.bottom + margin), slice(self.left - margin, self.right + margin)


def find_passages(walls: np.ndarray, cell_size: float) -> tuple[Passage, ...]:
    """Returns the passages of a building: `walls` is `[N, N]` bool, with a closed border, `cell_size` in metres."""
    widest, thickest = (metres / cell_size + _TOLERANCE for metres in (WIDEST, THICKEST))
    door, length, detour = (math.ceil(metres / cell_size - _TOLERANCE) for metres in (DOOR, THICKEST, DETOUR))
    passages = []
    for turned in (False, True):  # through strips from above to below, and, with the axes exchanged, from left to right
        grid = walls.T if turned else walls

        # Free from wall to wall.
        openings = _blocks(~grid)
        openings = openings[openings[:, 3] - openings[:, 1] <= widest]
        openings[:, 2] = np.minimum(openings[:, 2], openings[:, 0] + length)

        # A door in the middle of each piece of wall of one thickness, whole doors from its beginning.
        doors = _blocks(grid.T)[:, [1, 0, 3, 2]]
        top, left, bottom, right = doors.T
        doors = doors[(top > 0) & (bottom < len(walls)) & (bottom - top <= thickest) & (right - left >= door)]
        doors[:, 1] += (doors[:, 3] - doors[:, 1] - door) // (2 * door) * door
        doors[:, 3] = doors[:, 1] + door

        # Those whose sides are far by any other way.
        padded = np.pad(grid, detour, constant_values=True)
        for number, (top, left, bottom, right) in enumerate(np.concatenate([openings, doors]).tolist()):
            if _is_far(padded[top : bottom + 2 * detour, left : right + 2 * detour], detour):
                box = (left, top, right, bottom) if turned else (top, left, bottom, right)
                passages.append(Passage(*box, is_open=number < len(openings)))
    return tuple(passages)


def door_width(walls: np.ndarray, cell_size: float) -> float:
    """Returns the width of the doors of a building in metres: the lower quartile of its open passages, 1 without any.

    Short corridors are passages, too, and wider than doors.
    """
    return _door_width(walls.tobytes(), cell_size)


@functools.lru_cache(maxsize=32)
def _door_width(cells: bytes, cell_size: float) -> float:
    size = math.isqrt(len(cells))
    walls = np.frombuffer(cells, dtype=bool).reshape(size, size)
    widths = []
    for top, left, bottom, right, is_open in find_passages(walls, cell_size):
        if is_open:
            has_sides = walls[top:bottom, left - 1].all() and walls[top:bottom, right].all()
            widths.append(right - left if has_sides else bottom - top)
    return float(np.quantile(widths, 0.25, method="lower")) * cell_size if widths else 1.0


def _blocks(cells: np.ndarray) -> np.ndarray:
    """Returns the blocks of rows that follow each other and have the same run of True cells: `[B, 4]` int, boxes."""
    edges = np.diff(np.pad(cells, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    rows, starts = np.nonzero(edges == 1)
    ends = np.nonzero(edges == -1)[1]
    blocks: list[list[int]] = []
    for left, right, row in sorted(zip(starts.tolist(), ends.tolist(), rows.tolist(), strict=True)):
        if blocks and blocks[-1][1:] == [left, row, right]:
            blocks[-1][2] = row + 1
        else:
            blocks.append([row, left, row + 1, right])
    return np.array(blocks)


def _is_far(walls: np.ndarray, detour: int) -> bool:
    """Returns whether free cells above and below a strip are `detour` cells apart by any other way.

    `walls` is of the strip and so many cells around it. Ways do not lead through points where two free cells touch
    diagonally.
    """
    free = ~walls
    free[detour:-detour, detour:-detour] = False

    # A raster of half cells, with the sides and the corners of cells between their middles.
    halves = np.zeros(2 * np.array(free.shape) + 1, dtype=bool)
    halves[1::2, 1::2] = free
    strip = slice(2 * detour, -2 * detour)
    starts, goals = np.zeros((2, *halves.shape), dtype=bool)
    starts[2 * detour, strip] = ndimage.binary_dilation(halves[2 * detour - 1, strip])
    goals[-2 * detour - 1, strip] = ndimage.binary_dilation(halves[-2 * detour, strip])

    # Where ways can lead.
    can_pass = ndimage.binary_dilation(halves, np.ones((3, 3)))
    upper_left, upper_right, lower_left, lower_right = free[:-1, :-1], free[:-1, 1:], free[1:, :-1], free[1:, 1:]
    is_diagonal = (upper_left == lower_right) & (upper_right == lower_left) & (upper_left != upper_right)
    can_pass[2:-2:2, 2:-2:2] &= ~is_diagonal
    reached = ndimage.binary_dilation(starts, iterations=2 * (detour - 1), mask=can_pass | goals)
    can_tell = not (starts & ~can_pass).any()  # else it would depend on the raster
    return bool(starts.any() and goals.any() and can_tell and not (reached & goals).any())
