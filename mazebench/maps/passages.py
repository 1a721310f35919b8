"""Passages of any building: what can be closed in it, and where a door can be opened.

A passage is a straight strip of cells, all free (open) or all wall (walled), whose two sides are near each other
through it and far by any other way. Lengths are compared in metres, and ways run along the sides of cells, so that a
building has the same passages whether it is drawn with cells of 1 m or with four of 0.5 m for each.

`D` is the number of passages and `N` of rows and columns of a building.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mazebench.kernels import compiled

WIDEST = 2.4  # m, of an open passage
THICKEST = 1.0  # m, of a wall in which a door can be opened; of a longer open passage, so much is closed
DOOR = 0.9  # m, the width of a door that is opened
DETOUR = 6.0  # m, the least length of any other way between the two sides
_TOLERANCE = 1e-6  # cells


class Passages(NamedTuple):
    """Passages of a building."""

    boxes: np.ndarray  # [D, 4] int: of the strip's cells, the first row and column, and the end of rows and of columns
    is_open: np.ndarray  # [D] bool

    def box(self, index: int, margin: int = 0) -> tuple[slice, slice]:
        """Returns the rows and columns of a passage with a margin of some cells."""
        top, left, bottom, right = self.boxes[index].tolist()
        return slice(top - margin, bottom + margin), slice(left - margin, right + margin)


def find_passages(walls: np.ndarray, cell_size: float) -> Passages:
    """Returns the passages of a building.

    Args:
      walls: `[N, N]` bool, with a closed border.
      cell_size: in metres.
    """
    widest, thickest = (metres / cell_size + _TOLERANCE for metres in (WIDEST, THICKEST))
    door, length, detour = (math.ceil(metres / cell_size - _TOLERANCE) for metres in (DOOR, THICKEST, DETOUR))
    parts = []
    for turned in (False, True):  # through strips from above to below, and, with the axes exchanged, from left to right
        grid = np.array(walls.T if turned else walls, order="C")

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
        boxes = np.concatenate([openings, doors])
        is_far = _is_far(grid, boxes, detour)
        is_open = np.arange(len(boxes)) < len(openings)
        boxes = boxes[:, [1, 0, 3, 2]] if turned else boxes
        parts.append((boxes[is_far], is_open[is_far]))
    return Passages(*map(np.concatenate, zip(*parts, strict=True)))


def _blocks(cells: np.ndarray) -> np.ndarray:
    """Returns the blocks of rows that follow each other and have the same run of True cells: `[B, 4]` int, boxes."""
    edges = np.diff(np.pad(cells, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    rows, starts = np.nonzero(edges == 1)
    ends = np.nonzero(edges == -1)[1]
    order = np.lexsort((rows, ends, starts))
    runs = np.stack([rows, starts, ends], axis=1)[order]
    is_first = np.ones(len(runs), dtype=bool)
    is_first[1:] = (np.diff(runs, axis=0) != (1, 0, 0)).any(axis=1)
    is_last = np.append(is_first[1:], True)
    (top, left, right), bottom = runs[is_first].T, runs[is_last, 0] + 1
    return np.stack([top, left, bottom, right], axis=1)


@compiled
def _is_far(walls: np.ndarray, boxes: np.ndarray, detour: int) -> np.ndarray:
    """Returns the strips with free cells above and below that are `detour` cells apart by any other way: `[D]` bool.

    It searches from the lattice points between the strip and the free cells above to those below. Ways run along the
    sides of free cells, but not through a point at which two free cells touch diagonally.
    """
    size = len(walls) + 1  # of the lattice
    closed = walls.copy()
    is_far = np.zeros(len(boxes), dtype=np.bool_)
    seen, goals = np.full(size * size, -1), np.full(size * size, -1)
    queue = np.empty(size * size, dtype=np.int64)
    for number in range(len(boxes)):
        top, left, bottom, right = boxes[number]
        before = closed[top, left]
        closed[top:bottom, left:right] = True

        # The points at both sides.
        count, has_goal = 0, False
        for column in range(left, right):
            for point in (column, column + 1):
                if not closed[top - 1, column] and seen[top * size + point] != number:
                    seen[top * size + point] = number
                    queue[count] = top * size + point
                    count += 1
                if not closed[bottom, column]:
                    goals[bottom * size + point] = number
                    has_goal = True

        # Away from those above, point by point.
        is_far[number], begin = count > 0 and has_goal, 0
        for _ in range(detour - 1):
            end = count
            for index in range(begin, end):
                row, column = queue[index] // size, queue[index] % size
                upper_left, upper_right = not closed[row - 1, column - 1], not closed[row - 1, column]
                lower_left, lower_right = not closed[row, column - 1], not closed[row, column]
                if upper_left == lower_right and upper_right == lower_left and upper_left != upper_right:
                    is_far[number] &= begin > 0  # at the strip, it would depend on the raster
                    continue
                for step, is_free in (
                    (-size, upper_left or upper_right),
                    (-1, upper_left or lower_left),
                    (1, upper_right or lower_right),
                    (size, lower_left or lower_right),
                ):
                    point = queue[index] + step
                    if is_free and seen[point] != number:
                        seen[point] = number
                        queue[count] = point
                        count += 1
                        is_far[number] &= goals[point] != number
            begin = end
            if not is_far[number]:
                break
        closed[top:bottom, left:right] = before
    return is_far
