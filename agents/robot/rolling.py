"""The motion of a rolling body: one agent step of the world's physics, without MuJoCo. See `motion` for walls."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mazebench.constants import PHYSICS_TIMESTEP, STEPS_PER_ACTION
from mazebench.kernels import compiled
from mazebench.world.bodies import RollingBody
from mazebench.world.bodies.rolling import FOLLOWING, GRIP, SHARES

from .motion import CONTACT_DAMPING, CONTACT_STIFFNESS, IMPEDANCE, push_of_walls

# A capsule touches a wall by its two ends: how much more two contacts push than the one of `push_of_walls`.
_CONTACTS = 2 / (1 + IMPEDANCE)


class RollingMotion(NamedTuple):
    """The numbers of a body on which its motion depends, for kernels; see `RollingBody`. Forces are those on 1 kg."""

    acceleration: float  # m/s^2
    turn_acceleration: float  # rad/s^2
    top_speed: float  # m/s
    turn_rate: float  # rad/s
    reach: float  # m
    contact_damping: float  # 1/s
    contact_stiffness: float  # 1/s^2

    @classmethod
    def of(cls, body: RollingBody) -> RollingMotion:
        """Returns that of a body."""
        limits = body.acceleration, body.turn_acceleration, body.top_speed, body.turn_rate
        return cls(*limits, body.reach, CONTACT_DAMPING, CONTACT_STIFFNESS)


@compiled
def rolled(
    motion: RollingMotion,
    walls: np.ndarray,
    cell_size: float,
    x: float,
    y: float,
    vx: float,
    vy: float,
    yaw: float,
    turn: float,
    action: int,
) -> tuple[float, float, float, float, float, float]:
    """Returns what an action makes of position (m), velocity (m/s, on the map), yaw (rad) and yaw rate (rad/s)."""
    speed, rate = motion.top_speed * SHARES[action, 0], motion.turn_rate * SHARES[action, 1]
    cosine, sine = math.cos(yaw), math.sin(yaw)
    for _ in range(STEPS_PER_ACTION):
        # Along the heading the drive pulls, by at most its force; across it, the grip.
        ahead, aside = cosine * vx + sine * vy, cosine * vy - sine * vx
        pull, gain = FOLLOWING * (speed - ahead), FOLLOWING
        if abs(pull) > motion.acceleration:
            pull, gain = math.copysign(motion.acceleration, pull), 0.0
        hold = -GRIP * aside
        force_x, force_y = pull * cosine - hold * sine, pull * sine + hold * cosine
        push_x, push_y = push_of_walls(motion, walls, cell_size, x, y, vx, vy, force_x, force_y)

        # MuJoCo's integrator implicit takes the dampings of the next velocity.
        pull += _CONTACTS * (cosine * push_x + sine * push_y)
        hold += _CONTACTS * (cosine * push_y - sine * push_x)
        ahead += PHYSICS_TIMESTEP * pull / (1 + PHYSICS_TIMESTEP * gain)
        aside += PHYSICS_TIMESTEP * hold / (1 + PHYSICS_TIMESTEP * GRIP)
        vx, vy = cosine * ahead - sine * aside, sine * ahead + cosine * aside
        x, y = x + PHYSICS_TIMESTEP * vx, y + PHYSICS_TIMESTEP * vy

        # Its heading turns by a small angle, whose cosine and sine are the first parts of their series.
        twist, gain = FOLLOWING * (rate - turn), FOLLOWING
        if abs(twist) > motion.turn_acceleration:
            twist, gain = math.copysign(motion.turn_acceleration, twist), 0.0
        turn += PHYSICS_TIMESTEP * twist / (1 + PHYSICS_TIMESTEP * gain)
        angle = PHYSICS_TIMESTEP * turn
        yaw += angle
        small_cosine, small_sine = 1 - angle * angle / 2 + angle**4 / 24, angle - angle**3 / 6
        cosine, sine = cosine * small_cosine - sine * small_sine, sine * small_cosine + cosine * small_sine
    return x, y, vx, vy, yaw, turn
