"""A body that moves: its actions, what a state tells of it, and where it comes to rest.

Lengths are in cells of the map that the context shows, positions are (x, y) with x to the right and y up.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mazebench.constants import (
    ACTIONS,
    DISCRETE,
    FORWARD_VELOCITY,
    LEFT_VELOCITY,
    NUM_ACTIONS,
    VELOCITIES,
    YAW,
    YAW_RATE,
    X,
    Y,
)
from mazebench.world.bodies import Body
from mazebench.world.bodies.rolling import SHARES

FORWARD, BACKWARD, STRAFE_LEFT, STRAFE_RIGHT, LOOK_LEFT, LOOK_RIGHT = range(NUM_ACTIONS)

# The kinds of actions that the robots play, and those of a body that can't strafe.
PLAYED = (*DISCRETE, *VELOCITIES)
WITHOUT_STRAFING = ("four", "diff")

_VELOCITIES = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], np.float64)
_AS_KIND = {  # what each of the six is called in a kind that has it
    "six": np.arange(NUM_ACTIONS),
    "four": np.array([DISCRETE["four"].index(name) if name in DISCRETE["four"] else -1 for name in ACTIONS]),
    "velocity": _VELOCITIES,
    "diff": _VELOCITIES[:, [0, 2]],
}

Point = tuple[float, float]  # x, y


def as_kind(kind: str, actions: np.ndarray, body: Body) -> np.ndarray:
    """Returns actions `[B]` of a body's six as those of a kind: `[B]` int, or velocities `[B, 3]` or `[B, 2]`."""
    if kind == "diff" and not body.strafes:
        return SHARES[actions]
    return _AS_KIND[kind][actions]


def has_all_six(kind: str, body: Body) -> bool:
    """Returns whether a kind has an action for each of a body's six: to strafe, or to drive an arc."""
    return kind not in WITHOUT_STRAFING or (kind == "diff" and not body.strafes)


class MovingBody(NamedTuple):
    """Pose and velocities of a body, the latter in its own frame."""

    model: Body  # its shape and speeds
    x: float
    y: float
    yaw: float  # rad
    forward: float  # cells a second
    left: float  # cells a second
    turn: float = 0.0  # rad a second

    def velocity(self) -> Point:
        """Returns the velocity (x, y) on the map, in cells a second."""
        cosine, sine = math.cos(self.yaw), math.sin(self.yaw)
        return cosine * self.forward - sine * self.left, sine * self.forward + cosine * self.left

    def turned(self, heading: float) -> MovingBody:
        """Returns the body as if it had another heading (rad), with the velocity on the map that it has."""
        (x, y), cosine, sine = self.velocity(), math.cos(heading), math.sin(heading)
        return MovingBody(self.model, self.x, self.y, heading, cosine * x + sine * y, cosine * y - sine * x)

    def rest(self) -> Point:
        """Returns the point (x, y) at which the body comes to rest if it is let go now."""
        velocity_x, velocity_y = self.velocity()
        speed = math.hypot(velocity_x, velocity_y)
        rest_time = self.model.rest_time(speed)
        return self.x + rest_time * velocity_x, self.y + rest_time * velocity_y


def observed_body(model: Body, state: list[float], cells_per_metre: float) -> MovingBody:
    """Returns the body as a state `[12]` has it, whose x and y are taken for a place on the map."""
    x, y, forward, left = (cells_per_metre * state[index] for index in (X, Y, FORWARD_VELOCITY, LEFT_VELOCITY))
    return MovingBody(model, x=x, y=y, yaw=state[YAW], forward=forward, left=left, turn=state[YAW_RATE])
