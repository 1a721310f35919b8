"""Pure pursuit: drives along a path by aiming at a point a fixed distance ahead of the body."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mazebench.maps.maze import Cell, cell_to_point
from mazebench.world.angles import wrap_angle

from .moving_body import BACKWARD, FORWARD, LOOK_LEFT, LOOK_RIGHT, STRAFE_LEFT, STRAFE_RIGHT, MovingBody, Point

_LOOKAHEAD, _ROLLING_LOOKAHEAD = 0.8, 0.4  # m along the path to the point aimed at; a rolling body cuts no corners
_SEGMENTS_AHEAD = 3  # searched for the nearest one; with more, the nearest could be one of a parallel corridor
_LARGEST_MISALIGNMENT = math.radians(20)  # between a drive and the aim, before the body turns
_STRAIGHT, _ARC = math.radians(8), math.radians(35)  # the most of a rolling body's, before it drives an arc, or turns
# The headings of the four drives, in the order of their actions.
_DRIVES = (
    (FORWARD, 0.0),
    (BACKWARD, math.pi),
    (STRAFE_LEFT, math.pi / 2),
    (STRAFE_RIGHT, -math.pi / 2),
)


def steer(body: MovingBody, aim: Point, strafes: bool) -> int:
    """Returns the drive nearest to the direction of `aim`, or a turn if even that one is far off.

    `strafes` says whether there are the two actions by which a body strafes, or a rolling one drives an arc.
    """
    # Aimed from where the body would come to rest: aimed from where it is, it would overshoot and turn back.
    x, y = body.rest()
    bearing = math.atan2(aim[1] - y, aim[0] - x) - body.yaw - body.model.rest_turn(body.turn)
    if not body.model.strafes:
        return _roll(wrap_angle(bearing), strafes)
    drive, heading = min(_DRIVES if strafes else _DRIVES[:2], key=lambda drive: abs(wrap_angle(bearing - drive[1])))
    misalignment = wrap_angle(bearing - heading)
    if abs(misalignment) <= _LARGEST_MISALIGNMENT:
        return drive
    return LOOK_LEFT if misalignment > 0 else LOOK_RIGHT


def _roll(bearing: float, arcs: bool) -> int:
    """Returns the drive of a rolling body towards an aim at a bearing from its heading, in [-pi, pi) rad."""
    behind = wrap_angle(bearing - math.pi)
    if min(abs(bearing), abs(behind)) <= _STRAIGHT:
        return FORWARD if abs(bearing) < abs(behind) else BACKWARD
    if arcs and abs(bearing) <= _ARC:
        return STRAFE_LEFT if bearing > 0 else STRAFE_RIGHT
    off = bearing if abs(bearing) < abs(behind) else behind
    return LOOK_LEFT if off > 0 else LOOK_RIGHT


class Pilot:
    """A path that is followed, and how far along it the body is."""

    def __init__(self, path: Sequence[Cell], size: int, cells_per_metre: float):
        """Begins a path of cells on a map of `size` cells a side."""
        self.points: list[Point] = [(x, y) for x, y in cell_to_point(np.array(path), size).tolist()]
        self.cells_per_metre = cells_per_metre
        self.segment = 0  # the body is on the way from points[segment] to the next

    def action(self, body: MovingBody, strafes: bool) -> int:
        """Returns the drive or turn that brings the body towards the aim; see `steer`."""
        # The segment nearest to where the body comes to rest, this one or one of the next, and how far along it that
        # is. Centres of neighbouring cells are 1 apart. Of equally near segments, the last one.
        x, y = body.rest()
        along, least = 0.0, math.inf
        for index in range(self.segment, min(self.segment + _SEGMENTS_AHEAD, len(self.points) - 1)):
            start, end = self.points[index : index + 2]
            step_x, step_y = end[0] - start[0], end[1] - start[1]
            share = min(max((x - start[0]) * step_x + (y - start[1]) * step_y, 0.0), 1.0)
            distance = (x - start[0] - share * step_x) ** 2 + (y - start[1] - share * step_y) ** 2
            if distance <= least:
                least, along, self.segment = distance, share, index

        # The aim is a point ahead of it on the path, or the path's end if that is nearer.
        along += self.cells_per_metre * (_LOOKAHEAD if body.model.strafes else _ROLLING_LOOKAHEAD)
        for start, end in zip(self.points[self.segment :], self.points[self.segment + 1 :], strict=False):
            if along <= 1:
                return steer(
                    body, (start[0] + along * (end[0] - start[0]), start[1] + along * (end[1] - start[1])), strafes
                )
            along -= 1
        return steer(body, self.points[-1], strafes)
