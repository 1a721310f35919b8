"""What an episode has told of the maze, placed on the map: planes that a belief is computed from.

`K` is the number of readings, `R` of rays in each, `M` the side of the map. Positions are (row, column) on the map;
the centre of a cell has whole numbers.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mazebench.world.lidar import MAX_RANGE

from ..common.kernels import compiled, inlined

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
    reach: float = MAX_RANGE  # m, what a ray reads that meets no wall


@compiled
def add_readings(planes: np.ndarray, readings: Readings, to_map: np.ndarray) -> None:
    """Adds readings to the evidence `planes` `[G, 3, M, M]` float32.

    Args:
      planes: changed in place; those of SENSED, PASSED and FAILED.
      readings: of any of the G contexts.
      to_map: `[2, 2]` float32, rows and columns (first axis) of a metre in x and in y (second axis).
    """
    for k in range(len(readings.context)):
        evidence, position = planes[readings.context[k]], readings.position[k]
        if _is_on(evidence[SENSED], round(position[0]), round(position[1])):
            _add_body(evidence, position, readings.on_leg[k])
            _add_contacts(evidence, position, readings.velocity[k], readings.wished[k])
            _add_scan(evidence[SENSED], position, readings.yaw[k], readings.ranges[k], readings.reach, to_map)


@inlined
def _add_body(evidence: np.ndarray, position: np.ndarray, on_leg: bool) -> None:
    """Adds that the cell of the body is free, and passed on this leg, if `position` `[2]` is in its middle."""
    row, column = round(position[0]), round(position[1])
    if abs(position[0] - row) < _INSIDE and abs(position[1] - column) < _INSIDE:
        _move(evidence[SENSED], row, column, -1.0)
        if on_leg:
            evidence[PASSED, row, column] = 1.0


@inlined
def _add_contacts(evidence: np.ndarray, position: np.ndarray, velocity: np.ndarray, wished: np.ndarray) -> None:
    """Adds walls that stop the body: it is slower than wished along an axis, and beside the edge of its cell there."""
    row, column = round(position[0]), round(position[1])
    from_centre = position[0] - row, position[1] - column
    for axis in range(2):
        ahead, aside = from_centre[axis], from_centre[1 - axis]
        sign = 1 if wished[axis] > 0 else -1
        speed = sign * wished[axis]
        is_slow = speed > _WISHED and sign * velocity[axis] < _STOPPED * speed
        is_beside = 0.5 - sign * ahead < _TOUCHING and abs(aside) < _CLEAR
        if is_slow and is_beside:
            wall_row, wall_column = row + sign * (axis == 0), column + sign * (axis == 1)
            if _is_on(evidence[SENSED], wall_row, wall_column):
                _move(evidence[SENSED], wall_row, wall_column, 1.0)
                evidence[FAILED, wall_row, wall_column] += 1.0


@inlined
def _add_scan(
    sensed: np.ndarray, position: np.ndarray, yaw: float, ranges: np.ndarray, reach: float, to_map: np.ndarray
) -> None:
    """Adds that the rays of a scan `[R]` pass through free cells and end at walls."""
    for j in range(len(ranges)):
        # The direction on the map, in cells for a metre, then as a unit vector.
        angle = yaw + 2 * math.pi * j / len(ranges)
        x, y = math.cos(angle), math.sin(angle)
        down, right = to_map[0, 0] * x + to_map[0, 1] * y, to_map[1, 0] * x + to_map[1, 1] * y
        per_metre = math.hypot(down, right)
        if per_metre < 1e-3:
            continue
        length = ranges[j] * per_metre
        down, right = down / per_metre, right / per_metre

        # Cells are free in whose middle a point of the ray lies.
        row, column = -1, -1
        for i in range(int(length / _SAMPLE) + 1):
            at_row, at_column = position[0] + i * _SAMPLE * down, position[1] + i * _SAMPLE * right
            row, column = round(at_row), round(at_column)
            if abs(at_row - row) < _INSIDE and abs(at_column - column) < _INSIDE and _is_on(sensed, row, column):
                _move(sensed, row, column, -1.0)

        # The cell behind its end is a wall, unless the last point lies in it as well.
        if ranges[j] < reach:
            end = length + _BEHIND
            end_row, end_column = round(position[0] + end * down), round(position[1] + end * right)
            if (end_row != row or end_column != column) and _is_on(sensed, end_row, end_column):
                _move(sensed, end_row, end_column, 1.0)


@inlined
def _is_on(sensed: np.ndarray, row: int, column: int) -> bool:
    return 0 <= row < len(sensed) and 0 <= column < len(sensed)


@inlined
def _move(sensed: np.ndarray, row: int, column: int, found: float) -> None:
    """Moves SENSED of a cell on the map towards what was found: -1, free, or 1, a wall."""
    sensed[row, column] += _RATE * (found - sensed[row, column])
