"""Passages of any building: what can be closed in it, and where a door can be opened.

A passage is a straight strip of cells, all free (open) or all wall (walled), whose two sides are near each other
through it and far by any other way. Lengths are compared in metres, and ways run along the sides of cells, so that a
building has the same passages whether it is drawn with cells of 1 m or with four of 0.5 m for each.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from mazebench.kernels import compiled
from mazebench.maps.doors import Passage

WIDEST = 2.4  # m, of an open passage
THICKEST = 1.0  # m, of a wall in which a door can be opened; of a longer open passage, so much is closed
DOOR = 0.9  # m, the width of a door that is opened
DETOUR = 6.0  # m, the least length of any other way between the two sides
_TOLERANCE = 1e-6  # cells


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
        boxes = np.concatenate([openings, doors])
        for number in np.flatnonzero(_are_far(padded, boxes + detour, 2 * (detour - 1))).tolist():
            top, left, bottom, right = boxes[number].tolist()
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


@compiled
def _are_far(walls: np.ndarray, boxes: np.ndarray, most: int) -> np.ndarray:
    """Returns whether free cells above and below each strip are over `most` half cells apart by any other way.

    Ways lead along the sides of cells and through their middles, but not through points where two free cells touch
    diagonally. `walls` is `[H, W]` bool, with wider walls around than ways are long, and `boxes` (`[B, 4]` int) are
    first and last rows and columns of strips in it, as `Passage` has them.

    On the raster of half cells, cell (r, c) has its middle at (2 r + 1, 2 c + 1), its upper left corner at (2 r, 2 c).
    """
    height, width = 2 * len(walls) + 1, 2 * walls.shape[1] + 1
    reached = np.zeros((height, width), np.int64)  # by which strip, counted from 1
    queue = np.empty((height * width, 2), np.int64)
    is_far = np.zeros(len(boxes), np.bool_)
    for number in range(len(boxes)):
        box = boxes[number]
        top, left, bottom, right = box
        starts, goals = ~walls[top - 1, left:right], ~walls[bottom, left:right]
        if not (starts.any() and goals.any()):
            continue

        # The sides of the free cells above the strip.
        begin, end, can_tell = 0, 0, True
        for column in range(2 * left, 2 * right + 1):
            if _has_side(starts, column - 2 * left):
                can_tell &= _can_pass(walls, box, 2 * top, column)  # else it would depend on the raster
                queue[end] = 2 * top, column
                reached[2 * top, column] = number + 1
                end += 1

        # Ways from there, all by one step longer, until one gets to a free cell below.
        is_near = False
        for _ in range(most):
            if not can_tell or is_near or begin == end:
                break
            for index in range(begin, end):
                for down, aside in ((0, 1), (1, 0), (0, -1), (-1, 0)):
                    row, column = queue[index, 0] + down, queue[index, 1] + aside
                    is_goal = (
                        row == 2 * bottom and 2 * left <= column <= 2 * right and _has_side(goals, column - 2 * left)
                    )
                    is_near |= is_goal
                    if reached[row, column] != number + 1 and _can_pass(walls, box, row, column):
                        reached[row, column] = number + 1
                        queue[end] = row, column
                        end += 1
                begin += 1
        is_far[number] = can_tell and not is_near
    return is_far


@compiled
def _has_side(free: np.ndarray, half: int) -> bool:
    """Returns whether a half cell along a row of cells (`[W]` bool) is the middle or an end of a free one."""
    if half % 2:
        return bool(free[half // 2])
    return bool((half > 0 and free[half // 2 - 1]) or (half // 2 < len(free) and free[half // 2]))


@compiled
def _can_pass(walls: np.ndarray, box: np.ndarray, row: int, column: int) -> bool:
    """Returns whether ways lead through a place on the raster of half cells, where the strip in `box` is closed."""
    free = [False, False, False, False]  # the cells around it: above on the left and right, and below
    for index in range(4):
        above = row // 2 - (row % 2 == 0 and index < 2)
        before = column // 2 - (column % 2 == 0 and index % 2 == 0)
        is_closed = box[0] <= above < box[2] and box[1] <= before < box[3]
        free[index] = not walls[above, before] and not is_closed
    is_diagonal = free[0] == free[3] and free[1] == free[2] and free[0] != free[1]
    return (free[0] or free[1] or free[2] or free[3]) and not is_diagonal
