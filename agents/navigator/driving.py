"""How to get there: aims at the farthest point of the path that the body can reach in a straight line."""

from __future__ import annotations

import math

import numpy as np

from ..common.kernels import compiled, inlined

# Metres.
_CLEARANCE = 0.19  # of the body's centre from walls: its radius of 0.15, a contact's margin of 0.03, and a little
_SPACING = 0.25  # of the points of the path that are tried
_FARTHEST = 4.0  # along the path
_NEAREST = 0.75  # along the path, or cells if they are larger; aimed at if no farther point can be reached straight


@compiled
def aim(
    blocked: np.ndarray, points: np.ndarray, x: float, y: float, cells_per_metre: float = 1.0
) -> tuple[float, float]:
    """Returns the point (x, y) to drive at from (x, y); points are in cells.

    Args:
      blocked: `[N, N]` bool, the cells to keep clear of.
      points: `[P, 2]`, the centres of the path's cells; the body is in the first one.
      x: where the body would come to rest.
      y: likewise.
      cells_per_metre: of the map.
    """
    if len(points) == 1:
        return points[0, 0], points[0, 1]
    length = float(len(points) - 1)
    nearest = min(_NEAREST * max(cells_per_metre, 1.0), length)
    along = min(_FARTHEST * cells_per_metre, length)
    while along > nearest:
        aim_x, aim_y = _point_along(points, along)
        if is_clear(blocked, x, y, aim_x, aim_y, _CLEARANCE * cells_per_metre):
            return aim_x, aim_y
        along -= _SPACING * cells_per_metre
    return _point_along(points, nearest)


@inlined
def _point_along(points: np.ndarray, along: float) -> tuple[float, float]:
    segment = min(int(along), len(points) - 2)
    share = along - segment
    return (
        points[segment, 0] + share * (points[segment + 1, 0] - points[segment, 0]),
        points[segment, 1] + share * (points[segment + 1, 1] - points[segment, 1]),
    )


@compiled
def is_clear(blocked: np.ndarray, x0: float, y0: float, x1: float, y1: float, clearance: float) -> bool:
    """Returns whether a disc of radius `clearance` gets from (x0, y0) straight to (x1, y1) past the blocked cells."""
    size = len(blocked)
    left, right = math.floor(min(x0, x1) - clearance), math.floor(max(x0, x1) + clearance)
    bottom, top = math.floor(min(y0, y1) - clearance), math.floor(max(y0, y1) + clearance)
    for level in range(max(bottom, 0), min(top, size - 1) + 1):
        for column in range(max(left, 0), min(right, size - 1) + 1):
            if blocked[size - 1 - level, column] and _meets(x0, y0, x1, y1, column, level, clearance):
                return False
    return True


@compiled
def _meets(x0: float, y0: float, x1: float, y1: float, column: int, level: int, clearance: float) -> bool:
    """Returns whether a segment comes nearer than `clearance` to a cell; `level` is the row counted from below."""
    # The distance from a convex cell is convex along the segment, so that a search by thirds finds the least one.
    low, high = 0.0, 1.0
    for _ in range(12):
        third = (high - low) / 3
        if _distance(x0, y0, x1, y1, low + third, column, level) < _distance(
            x0, y0, x1, y1, high - third, column, level
        ):
            high -= third
        else:
            low += third
    return _distance(x0, y0, x1, y1, (low + high) / 2, column, level) < clearance


@compiled
def _distance(x0: float, y0: float, x1: float, y1: float, share: float, column: int, level: int) -> float:
    x, y = x0 + share * (x1 - x0), y0 + share * (y1 - y0)
    return math.hypot(max(column - x, 0.0, x - column - 1), max(level - y, 0.0, y - level - 1))
