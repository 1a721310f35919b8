"""Kernels that look along straight lines through a maze: which corners see each other, and what a disc can pass."""

from __future__ import annotations

import math

import numpy as np

from mazebench.kernels import compiled

_TOLERANCE = 1e-9  # of slopes and of crossings, in cells


@compiled
def taut_pairs(walls: np.ndarray, points: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns the pairs `first < second` of corners that a segment joins: `[P]` int, twice.

    It enters no wall, and is no way into the quadrant opposite to the wall of either corner, where a taut string would
    leave the corner. A corner looks to the right through one column of cells after the other. The rays that have passed
    a column form intervals of slopes, one for each opening between walls.

    Args:
      walls: `[N, N]` bool, indexed `[x, y]`, with a closed border.
      points: `[K, 2]` int, corners (x, y) in order, each with a wall in one quadrant only.
      normals: `[K, 2]` int, signs (x, y) of the quadrant opposite to the wall.
    """
    number = np.full((len(walls) + 1, len(walls) + 1), -1)
    for index in range(len(points)):
        number[points[index, 0], points[index, 1]] = index
    first, second = [0 for _ in range(0)], [0 for _ in range(0)]  # numba takes the type from the elements
    for index in range(len(points)):
        x0, y0 = points[index]
        rises = normals[index, 0] != normals[index, 1]

        # To the right and up, as long as one side is free. A string that goes on is straight there, too.
        for right, up in ((1, 0), (0, 1)):
            x, y, other = x0, y0, -1
            while other < 0 and not (walls[x - up, y - right] and walls[x, y]):
                x, y = x + right, y + up
                other = number[x, y]
            if other >= 0:
                first.append(index)
                second.append(other)

        # Aslant to the right, at first through all that is free beside the point.
        bottom, top = y0, y0
        while not rises and not walls[x0, bottom - 1]:
            bottom -= 1
        while rises and not walls[x0, top]:
            top += 1
        intervals = [(1, float(bottom - y0), float(top - y0))]
        while intervals:
            passed, low, high = intervals.pop()
            bottom, top = math.ceil(y0 + low * passed - _TOLERANCE), math.floor(y0 + high * passed + _TOLERANCE)
            for y in range(bottom, top + 1):
                other = number[x0 + passed, y]
                if other >= 0 and y != y0 and (normals[other, 0] != normals[other, 1]) == rises:
                    first.append(index)
                    second.append(other)

            # The next column: the rays that enter and leave it between the walls below `bottom` and above `top`.
            column = walls[x0 + passed]
            beyond = passed + 1
            top = math.floor(y0 + min(low * passed, low * beyond) - _TOLERANCE)
            end = math.ceil(y0 + max(high * passed, high * beyond) + _TOLERANCE)
            while top < end:
                bottom = top
                while top < end and not column[top]:
                    top += 1
                lowest = max(low, (bottom - y0) / passed, (bottom - y0) / beyond)
                highest = min(high, (top - y0) / passed, (top - y0) / beyond)
                if bottom < top and lowest <= highest + _TOLERANCE:
                    intervals.append((beyond, lowest, highest))
                top += 1
    return np.array(first), np.array(second)


@compiled
def clear_segments(
    has_corner: np.ndarray, has_edge: np.ndarray, ends: np.ndarray, radius: float, clearance: float
) -> np.ndarray:
    """Returns whether segments between free points keep away from walls: `[S]` bool.

    They do unless a corner of a wall is too near or they enter a wall. Both show on the lattice's lines across a
    segment's longer axis: the two lattice points about a crossing are the only ones on that line within half a cell,
    and between two lines the segment changes cells at most once.

    Args:
      has_corner: `[2, N + 1, N + 1]` bool, whether a wall is at a lattice point (x, y), and the same of (y, x).
      has_edge: `[2, N + 1, N + 1]` bool, whether a wall is beside the line from there to (x, y + 1), and likewise.
      ends: `[S, 2, 2]`, the two ends (x, y) of each, at least the radius away from walls.
      radius: of the disc, in cells.
      clearance: at which a corner is too near.
    """
    clear = np.ones(len(ends), dtype=np.bool_)
    for index in range(len(ends)):
        # Exchange ends and axes such that the segment leads to the right, with a slope of at most 1 either way.
        (x, y), (last_x, last_y) = ends[index]
        extent, rise = last_x - x, last_y - y
        is_steep = abs(rise) > abs(extent)
        if (rise if is_steep else extent) < 0:
            x, y, extent, rise = last_x, last_y, -extent, -rise
        if is_steep:
            x, y, extent, rise = y, x, rise, extent
        corners, edges = has_corner[int(is_steep)], has_edge[int(is_steep)]
        slope = rise / extent if extent else 0.0
        squared_cosine = 1 / (1 + slope * slope)
        reach, shift = clearance / math.sqrt(squared_cosine), slope * squared_cosine

        for line in range(math.ceil(x - radius), math.floor(x + extent + radius) + 1):
            along = line - x
            height = y + slope * along
            below = math.floor(height)
            is_blocked = edges[line, below] and 0 <= along <= extent
            for corner in (below, below + 1):
                foot = along - (height - corner) * shift
                is_blocked |= corners[line, corner] and abs(height - corner) < reach and 0 < foot < extent
            if is_blocked:
                clear[index] = False
                break
    return clear
