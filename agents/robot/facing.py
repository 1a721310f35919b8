"""Driving one way while turning to look another way, with the actions `velocity`.

A drive is planned for a body with a heading of its own, which looks do not change; the body turns as it likes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mazebench.maps.maze import Cell, cell_to_point
from mazebench.world.angles import wrap_angle

from .body import LOOK_LEFT, LOOK_RIGHT, TURN_STEP, Body
from .motion import BEARINGS

_AHEAD = 3  # cells along the path to the one that the body turns to


def as_if_turned(body: Body, heading: float) -> Body:
    """Returns the body as if it had another heading (rad), with the velocity that it has."""
    (x, y), cosine, sine = body.velocity(), math.cos(heading), math.sin(heading)
    return body._replace(yaw=heading, forward=cosine * x + sine * y, left=cosine * y - sine * x)


def turn_along(path: Sequence[Cell], body: Body, size: int) -> float:
    """Returns the share of a look to the left, from -1 to 1, that turns a body towards the third cell of its path.

    Without a path, it looks round. The grid has `size` cells a side.
    """
    if len(path) < 2:
        return float(not path)
    x, y = cell_to_point(path[min(_AHEAD, len(path) - 1)], size).tolist()
    return float(np.clip(wrap_angle(math.atan2(y - body.y, x - body.x) - body.yaw) / TURN_STEP, -1, 1))


def driven_while_turning(body: Body, heading: float, action: int, turn: float) -> tuple[float, float, float]:
    """Returns velocities: to drive as `action` would with a heading, and to turn by a share of a look to the left."""
    if action in (LOOK_LEFT, LOOK_RIGHT):
        return 0.0, 0.0, turn
    bearing = heading + BEARINGS[action] - body.yaw - turn * TURN_STEP / 2
    return math.cos(bearing), math.sin(bearing), turn
