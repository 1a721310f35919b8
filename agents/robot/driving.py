"""The quickest drive through the free cells around the next part of a path.

It is planned a few steps ahead with a model of the body's motion (a dynamic window: Fox, Burgard & Thrun 1997), by the
same search as the oracle's, with a narrower beam.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from mazebench.constants import STEP_TIME
from mazebench.maps.maze import Cell, cell_to_point
from mazebench.world.angles import wrap_angle

from .any_body import Motions, quickest, step_in_the_open
from .moving_body import LOOK_LEFT, MovingBody, Point
from .pilot import steer
from .quickest import make_course
from .senses import Memory

_WAY_AHEAD = 7.0  # m of the path
_STEPS_AHEAD = 7  # that are planned
_STEPS_AHEAD_TURNING = 11  # if the body can't strafe: a quarter turn takes 4 or 5
_STEPS_USED = 4  # of them
# Of a rolling body, which brakes and turns slowly: the steps and the metres that are planned at least, the metres that
# are used of them, and the width of the beam.
_ROLLING_STEPS, _ROLLING_AHEAD, _ROLLED, _ROLLING_WIDTH = 24, 1.2, 0.4, 8
_WIDTH = 4  # of the beam, for each heading
_INSIDE = 0.05  # share of a cell, from the edges of the one that the body is in
_FASTEST = 1.1  # times the top speed; more is an error of the observation
_BLOCKED = 0.35  # probability of a wall from which driving keeps clear of a cell off the path
_MOST_OFF = 0.08  # m from where the body should be, before the drive is planned anew
_MOST_ASKEW = 0.15  # rad from the heading that a rolling body should have, likewise


@dataclasses.dataclass
class Drive:
    """The rest of a drive that was planned."""

    actions: list[int] = dataclasses.field(default_factory=list)
    points: list[Point] = dataclasses.field(default_factory=list)  # where each action begins, m
    yaws: list[float] = dataclasses.field(default_factory=list)  # and with which heading, rad
    path: list[Cell] = dataclasses.field(default_factory=list)  # the cells ahead when it was planned
    turn: float | None = None  # looks to the left in the last action; None for those that it is

    def follow(self, path: list[Cell], walls: np.ndarray, memory: Memory, strafes: bool) -> int:
        """Returns the next action along `path`, around likely `walls` `[L, L]` float; a turn where there is no path."""
        action, point = self.planned(path, walls, memory.body, memory.cell_size, strafes)
        memory.command(action, point, turn=self.turn)
        return action

    def planned(
        self, path: list[Cell], walls: np.ndarray, body: MovingBody, cell_size: float, strafes: bool = True
    ) -> tuple[int, Point]:
        """Returns that action, and the point (x, y) that it should bring the body to."""
        self.turn = None
        if len(path) <= 1:
            goal = tuple(cell_to_point(path[0], len(walls)).tolist()) if path else None
            action = LOOK_LEFT if goal is None else steer(body, goal, strafes)
            if not body.model.strafes:
                self.turn = step_in_the_open(body, action, cell_size)[1] / body.model.turn_step
            return action, body.rest()
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
        is_askew = not body.model.strafes and bool(self.yaws) and abs(wrap_angle(self.yaws[0] - body.yaw)) > _MOST_ASKEW
        if not continues or not self.actions or is_askew or math.dist(self.points[0], (x, y)) > _MOST_OFF:
            # The part of the grid around the path, with walls around it.
            cells, size = np.array(ahead), len(blocked)
            top, left = cells.min(axis=0) - 2
            side = int(np.ptp(cells, axis=0).max()) + 5
            walls = np.ones((side, side), dtype=bool)
            rows, columns = (np.arange(max(first + 1, 0), min(first + side - 1, size)) for first in (top, left))
            walls[np.ix_(rows - top, columns - left)] = blocked[np.ix_(rows, columns)]

            # In metres from its lower left corner. The body is in the first cell, whatever is observed.
            corner = np.array([left, size - top - side])
            row, column = ahead[0]
            first = np.array([column, size - 1 - row])
            inside = np.clip((body.x, body.y), first + _INSIDE, first + 1 - _INSIDE)
            x, y = ((inside - corner) * cell_size).tolist()
            fastest = _FASTEST * body.model.top_speed
            velocity = np.clip(np.array(body.velocity()) * cell_size, -fastest, fastest).tolist()
            course = make_course(body.model, walls, cell_size, (int(ahead[-1][0] - top), int(ahead[-1][1] - left)))
            steps, used = _STEPS_AHEAD if strafes else _STEPS_AHEAD_TURNING, _STEPS_USED
            width = _WIDTH
            if not body.model.strafes:
                step = body.model.top_speed * STEP_TIME
                steps, used = max(_ROLLING_STEPS, math.ceil(_ROLLING_AHEAD / step)), max(used, round(_ROLLED / step))
                width = _ROLLING_WIDTH
            motions = Motions(tuple(velocity), body.turn)
            actions, poses = quickest(course, (x, y), motions, body.yaw, steps, width, strafes)
            self.actions, self.path = actions[:used], ahead
            shift = corner * cell_size
            self.points = [(body.x * cell_size, body.y * cell_size), *(tuple(shift + each[:2]) for each in poses)]
            self.yaws = [body.yaw, *(yaw for _, _, yaw in poses)]

        before, after = self.points.pop(0), self.points[0]
        yaw = self.yaws.pop(0)
        self.turn = None if body.model.strafes else (self.yaws[0] - yaw) / body.model.turn_step
        point = body.x + (after[0] - before[0]) / cell_size, body.y + (after[1] - before[1]) / cell_size
        return self.actions.pop(0), point
