"""The quickest drive through the free cells around the next part of a path.

It is planned a few steps ahead with a model of the body's motion (a dynamic window: Fox, Burgard & Thrun 1997), by the
same search as the oracle's, with a narrower beam.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from mazebench.maps.maze import Cell, cell_to_point

from .moving_body import LOOK_LEFT, MovingBody, Point
from .pilot import steer
from .quickest import make_course, quickest_drive
from .senses import Memory

_WAY_AHEAD = 7.0  # m of the path
_STEPS_AHEAD = 7  # that are planned
_STEPS_AHEAD_TURNING = 11  # if the body can't strafe: a quarter turn takes 4 or 5
_STEPS_USED = 4  # of them
_WIDTH = 4  # of the beam, for each heading
_INSIDE = 0.05  # share of a cell, from the edges of the one that the body is in
_FASTEST = 1.1  # times the top speed; more is an error of the observation
_BLOCKED = 0.35  # probability of a wall from which driving keeps clear of a cell off the path
_MOST_OFF = 0.08  # m from where the body should be, before the drive is planned anew


@dataclasses.dataclass
class Drive:
    """The rest of a drive that was planned."""

    actions: list[int] = dataclasses.field(default_factory=list)
    points: list[Point] = dataclasses.field(default_factory=list)  # where each action begins, m
    path: list[Cell] = dataclasses.field(default_factory=list)  # the cells ahead when it was planned

    def follow(self, path: list[Cell], walls: np.ndarray, memory: Memory, strafes: bool) -> int:
        """Returns the next action along `path`, around likely `walls` `[L, L]` float; a turn where there is no path."""
        action, point = self.planned(path, walls, memory.body, memory.cell_size, strafes)
        memory.command(action, point)
        return action

    def planned(
        self, path: list[Cell], walls: np.ndarray, body: MovingBody, cell_size: float, strafes: bool = True
    ) -> tuple[int, Point]:
        """Returns that action, and the point (x, y) that it should bring the body to."""
        if len(path) == 1:
            return steer(body, tuple(cell_to_point(path[0], len(walls)).tolist()), strafes), body.rest()
        if not path:
            return LOOK_LEFT, body.rest()
        blocked = walls > _BLOCKED
        blocked[tuple(np.transpose(path))] = False
        return self.next(blocked, path, body, cell_size, strafes)

    def next(
        self, blocked: np.ndarray, path: list[Cell], body: MovingBody, cell_size: float, strafes: bool = True
    ) -> tuple[int, Point]:
        """Returns the next action along `path`, and the point (x, y) that it should bring the body to, in cells.

        The drive keeps clear of `blocked` `[L, L]` bool; `cell_size` is in m, and `strafes` says whether the body can.
        """
        # The drive ends where the body is not where it should be, or the path does not go on as it did.
        ahead = path[: round(_WAY_AHEAD / cell_size) + 1]
        x, y = body.x * cell_size, body.y * cell_size
        rest = self.path[self.path.index(ahead[0]) :] if ahead[0] in self.path else []
        continues = bool(rest) and ahead[: len(rest)] == rest[: len(ahead)]
        if not continues or not self.actions or math.dist(self.points[0], (x, y)) > _MOST_OFF:
            # The part of the grid around the path, with walls around it.
            rows, columns = zip(*ahead, strict=True)
            top, left, size = min(rows) - 2, min(columns) - 2, len(blocked)
            side = max(max(rows) - top, max(columns) - left) + 3
            walls = np.ones((side, side), dtype=bool)
            inner = tuple(slice(max(first + 1, 0), min(first + side - 1, size)) for first in (top, left))
            walls[_shifted(inner[0], -top), _shifted(inner[1], -left)] = blocked[inner]

            # In metres from its lower left corner. The body is in the first cell, whatever is observed.
            corner_x, corner_y = left, size - top - side
            (row, column), (last_row, last_column) = ahead[0], ahead[-1]
            x = (_within(body.x, column) - corner_x) * cell_size
            y = (_within(body.y, size - 1 - row) - corner_y) * cell_size
            fastest = _FASTEST * body.model.top_speed
            vx, vy = (min(max(speed * cell_size, -fastest), fastest) for speed in body.velocity())
            course = make_course(body.model, walls, cell_size, (last_row - top, last_column - left))
            steps = _STEPS_AHEAD if strafes else _STEPS_AHEAD_TURNING
            actions, points = quickest_drive(course, (x, y), (vx, vy), body.yaw, steps, _WIDTH, strafes)
            self.actions, self.path = actions[:_STEPS_USED], ahead
            shift_x, shift_y = corner_x * cell_size, corner_y * cell_size
            self.points = [(body.x * cell_size, body.y * cell_size), *((shift_x + x, shift_y + y) for x, y in points)]

        before, after = self.points.pop(0), self.points[0]
        point = body.x + (after[0] - before[0]) / cell_size, body.y + (after[1] - before[1]) / cell_size
        return self.actions.pop(0), point


def _shifted(cells: slice, by: int) -> slice:
    return slice(cells.start + by, cells.stop + by)


def _within(coordinate: float, cell: int) -> float:
    """Returns the coordinate nearest to one that is well inside of a cell (both in cells)."""
    return min(max(coordinate, cell + _INSIDE), cell + 1 - _INSIDE)
