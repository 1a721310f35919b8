"""Walls that are felt: a body without lidar is stopped by a wall where it should have moved on.

Lengths are in cells but where a name says metres. The grid has `L` x `L` cells with its lower left corner at (0, 0).
"""

from __future__ import annotations

from mazebench.maps.maze import Cell

from .any_body import step_in_the_open
from .moving_body import MovingBody

_STOPPED = 0.25  # m/s along an axis that the body is slower than it would be in the open, if a wall stopped it
_SLACK = 0.04  # m from which a wall pushes more than the model says, for errors of both
_GIVE = 0.06  # m that a wall lets the body come into its reach, at most; a body that is deeper was stopped by a corner
_CLEAR = 0.14  # m from the edge of a cell, at least, where the body touches no corner of a wall beside it
_SURELY, _PERHAPS = 4.0, 1.0  # log odds of a wall: where no other one can have stopped the body, and where one can


def felt_walls(
    before: MovingBody, action: int, after: MovingBody, cell_size: float, deviation: float, size: int
) -> list[tuple[Cell, float]]:
    """Returns the cells beside the body that may have stopped it in a step, none in most steps, and their log odds.

    `before` and `after` are the body before and after the step, `cell_size` and the position's `deviation` are in m.
    `size` is L.
    """
    free, _ = step_in_the_open(before, action, cell_size)
    column, level = int(after.x), int(after.y)
    off_middle = after.x - column - 0.5, after.y - level - 0.5
    off_before = before.x - column - 0.5, before.y - level - 0.5
    found = []
    for axis in range(2):
        speed, sign = abs(free[axis]), 1 if free[axis] > 0 else -1
        is_slow = speed - sign * cell_size * after.velocity()[axis] > _STOPPED
        gap = cell_size * (0.5 - sign * off_middle[axis])
        # Beside an edge of its cell, then or before, the corner of another wall may have stopped it.
        off_aside = max(abs(off_middle[1 - axis]), abs(off_before[1 - axis]))
        is_near = -_GIVE - deviation < gap - before.model.reach < _SLACK + deviation
        if is_slow and off_aside < 0.5 and is_near:
            row = size - 1 - level - (sign if axis == 1 else 0)
            cell = row, column + (sign if axis == 0 else 0)
            if min(cell) >= 0 and max(cell) < size:
                found.append((cell, _SURELY if off_aside < 0.5 - _CLEAR / cell_size else _PERHAPS))
    return found
