"""Where on the shown map a body stands whose pose is odometry: its first lidar reading is compared with the map."""

from __future__ import annotations

import math

import numpy as np

from mazebench.world.lidar import MAX_RANGE

from ..common.kernels import compiled, inlined
from ..robot.body import YAW, X, Y

_HEADINGS = 64  # that are tried
_FINER = 16  # parts of the step between two of them, tried around the best one
_SAMPLE = 0.5  # cells between the points of a ray that are looked at
_BEHIND = 0.2  # cells behind the end of a ray, where the wall is


def is_odometry(state: np.ndarray) -> bool:
    """Returns whether an episode's first state `[12]` has its pose at the origin, which is outside of all mazes."""
    return not state[[X, Y, YAW]].any()


def find_pose(
    walls: np.ndarray, ranges: np.ndarray, cells: np.ndarray, to_map: np.ndarray, reach: float = MAX_RANGE
) -> tuple[np.ndarray, float]:
    """Returns the cell `[2]` and the heading (rad) at which a reading of the lidar fits the map best.

    Args:
      walls: `[M, M]` float32, the share of wall in each cell.
      ranges: `[R]` float32, m.
      cells: `[C, 2]` int, in the middle of which the body may be.
      to_map: `[2, 2]` float32, rows and columns (first axis) of a metre in x and in y (second axis).
      reach: m, what a ray reads that meets no wall.
    """
    step = 2 * math.pi / _HEADINGS
    index, heading = _best(walls, ranges, cells, to_map, np.arange(_HEADINGS) * step, reach)
    finer = heading + np.linspace(-step, step, 2 * _FINER + 1)
    _, heading = _best(walls, ranges, cells[index : index + 1], to_map, finer, reach)
    return cells[index], float(heading)


@compiled
def _best(
    walls: np.ndarray, ranges: np.ndarray, cells: np.ndarray, to_map: np.ndarray, headings: np.ndarray, reach: float
) -> tuple[int, float]:
    """Returns the index of the cell, and the heading, whose rays pass through the least wall and end at the most."""
    best, best_cell, best_heading = -math.inf, 0, 0.0
    for i in range(len(cells)):
        for heading in headings:
            fit = _fit(walls, ranges, cells[i], to_map, heading, reach)
            if fit > best:
                best, best_cell, best_heading = fit, i, heading
    return best_cell, best_heading


@inlined
def _fit(
    walls: np.ndarray, ranges: np.ndarray, cell: np.ndarray, to_map: np.ndarray, heading: float, reach: float
) -> float:
    """Returns the wall behind the ends of rays, less that on the way to them, in cells; beyond the map is wall."""
    fit = 0.0
    for j in range(len(ranges)):
        angle = heading + 2 * math.pi * j / len(ranges)
        x, y = math.cos(angle), math.sin(angle)
        down, right = to_map[0, 0] * x + to_map[0, 1] * y, to_map[1, 0] * x + to_map[1, 1] * y
        along = 0.0
        while along < ranges[j]:
            fit -= _SAMPLE * _wall_at(walls, cell[0] + along * down, cell[1] + along * right, 0.0)
            along += _SAMPLE
        if ranges[j] < reach:
            end = ranges[j] + _BEHIND
            fit += _wall_at(walls, cell[0] + end * down, cell[1] + end * right, 1.0)
    return fit


@inlined
def _wall_at(walls: np.ndarray, row: float, column: float, beyond: float) -> float:
    """Returns the share of wall in the cell at a position, `beyond` if there is none."""
    r, c = round(row), round(column)
    return walls[r, c] if 0 <= r < len(walls) and 0 <= c < len(walls) else beyond
