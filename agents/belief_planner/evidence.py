"""What an episode has told of the maze, placed on the map: planes that a belief is computed from.

`K` is the number of readings, `R` of rays in each, `M` the side of the map. Positions are (row, column) on the map;
the centre of a cell has whole numbers.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mazebench.world.lidar import MAX_RANGE

from ..common.kernels import compiled

NUM_EVIDENCE = 3
# From -1, surely free, to 1, surely wall; 1 where the body was on this leg; in how many steps a cell stopped the body.
SENSED, PASSED, FAILED = range(NUM_EVIDENCE)

_RATE = 0.4  # by which a reading moves SENSED of a cell towards -1 or 1
_INSIDE = 0.4  # cells from the centre of a cell, along each axis, within which it is told from its neighbours
_WISHED = 0.15  # of the top speed along an axis: what the body wanted at least, if a wall may have stopped it
_STOPPED = 0.5  # of the wished speed: what it has at most, if it was stopped
_TOUCHING = 0.32  # cells from the body's centre to the wall that stops it; the body's radius is 0.15 m
_CLEAR = 0.36  # cells aside from the centre of a cell, at most, where the body touches no corner of a wall
_SAMPLE = 0.25  # cells between the points of a ray that are looked at
_BEHIND = 0.15  # cells behind the end of a ray, where the wall is


class Readings(NamedTuple):
    """What was observed in K steps; those of one context are in the order of time."""

    context: np.ndarray  # [K] int, whose planes they belong to
    on_leg: np.ndarray  # [K] bool, whether they belong to the leg to the present goal
    position: np.ndarray  # [K, 2] float32, estimated
    velocity: np.ndarray  # [K, 2] float32, along rows and columns, of a top speed of 1
    wished: np.ndarray  # [K, 2] float32, the velocity without obstacles; 0 if unknown
    yaw: np.ndarray  # [K] float32, rad
    ranges: np.ndarray  # [K, R] float32, m; R = 0 without lidar


def place(planes: np.ndarray, readings: Readings, to_map: np.ndarray) -> None:
    """Adds readings to the evidence `planes` `[G, 3, M, M]` float32.

    The body is where it is, so its cell is free. A body that is slower than it wished, beside the edge of a cell, was
    stopped by a wall. A ray of the lidar passes through free cells and ends at a wall.

    Args:
      planes: changed in place; those of SENSED, PASSED and FAILED.
      readings: of any of the G contexts.
      to_map: `[2, 2]` float32, rows and columns (first axis) of a metre in x and in y (second axis).
    """
    _place(planes, *readings, to_map)


@compiled
def _place(
    planes: np.ndarray,
    context: np.ndarray,
    on_leg: np.ndarray,
    position: np.ndarray,
    velocity: np.ndarray,
    wished: np.ndarray,
    yaw: np.ndarray,
    ranges: np.ndarray,
    to_map: np.ndarray,
) -> None:
    size, num_rays = planes.shape[2], ranges.shape[1]
    for k in range(len(context)):
        sensed, passed, failed = planes[context[k], SENSED], planes[context[k], PASSED], planes[context[k], FAILED]
        row, column = position[k]
        r, c = round(row), round(column)
        if not (0 <= r < size and 0 <= c < size):
            continue
        from_row, from_column = row - r, column - c
        if abs(from_row) < _INSIDE and abs(from_column) < _INSIDE:
            sensed[r, c] += _RATE * (-1 - sensed[r, c])
            if on_leg[k]:
                passed[r, c] = 1.0
        for axis in range(2):
            ahead, aside = (from_row, from_column) if axis == 0 else (from_column, from_row)
            sign = 1 if wished[k, axis] > 0 else -1
            speed = sign * wished[k, axis]
            if (
                speed > _WISHED
                and sign * velocity[k, axis] < _STOPPED * speed
                and 0.5 - sign * ahead < _TOUCHING
                and abs(aside) < _CLEAR
            ):
                ahead_r, ahead_c = r + sign * (axis == 0), c + sign * (axis == 1)
                if 0 <= ahead_r < size and 0 <= ahead_c < size:
                    _mark(sensed, ahead_r, ahead_c, 1.0)
                    failed[ahead_r, ahead_c] += 1.0
        for j in range(num_rays):
            angle = yaw[k] + 2 * math.pi * j / num_rays
            x, y = math.cos(angle), math.sin(angle)
            down, right = to_map[0, 0] * x + to_map[0, 1] * y, to_map[1, 0] * x + to_map[1, 1] * y
            per_metre = math.hypot(down, right)
            if per_metre < 1e-3:
                continue
            length = ranges[k, j] * per_metre
            down, right = down / per_metre, right / per_metre
            last_r, last_c = -1, -1
            for i in range(int(length / _SAMPLE) + 1):
                at_row, at_column = row + i * _SAMPLE * down, column + i * _SAMPLE * right
                last_r, last_c = round(at_row), round(at_column)
                if abs(at_row - last_r) < _INSIDE and abs(at_column - last_c) < _INSIDE:
                    _mark(sensed, last_r, last_c, -1.0)
            if ranges[k, j] < MAX_RANGE:
                end = length + _BEHIND
                end_r, end_c = round(row + end * down), round(column + end * right)
                if end_r != last_r or end_c != last_c:
                    _mark(sensed, end_r, end_c, 1.0)


@compiled
def _mark(sensed: np.ndarray, row: int, column: int, found: float) -> None:
    if 0 <= row < len(sensed) and 0 <= column < len(sensed):
        sensed[row, column] += _RATE * (found - sensed[row, column])
