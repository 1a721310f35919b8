"""The motion of a sliding body: one agent step of the world's physics, without MuJoCo.

A drive pulls the body in one direction, against damping. Walls push it off by MuJoCo's soft contacts, without friction.
A map is `[N, N]` bool here, indexed by x and y.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mazebench.constants import PHYSICS_TIMESTEP, STEPS_PER_ACTION
from mazebench.errors import InputError
from mazebench.kernels import compiled, inlined
from mazebench.world.bodies import Body, SlidingBody
from mazebench.world.bodies.body import CONTACT_SOLREF

NO_WALLS = np.zeros((3, 3), dtype=bool)
BEARINGS = np.array([0.0, math.pi, math.pi / 2, -math.pi / 2])  # of the four drives, from the heading
# Of a contact of 1 kg, computed from its time constant and its damping ratio as MuJoCo's documentation of solref has
# it, for an impedance of 0.95.
IMPEDANCE = 0.95
CONTACT_DAMPING = 2 / (IMPEDANCE * CONTACT_SOLREF[0])
CONTACT_STIFFNESS = (CONTACT_DAMPING / (2 * CONTACT_SOLREF[1])) ** 2


class Motion(NamedTuple):
    """The numbers of a body on which its motion depends, for kernels; see `SlidingBody`."""

    mass: float  # kg
    damping: float  # N s/m
    gain: float  # N s/m
    drive_speed: float  # m/s
    max_force: float  # N
    reach: float  # m
    contact_damping: float  # N s/m
    contact_stiffness: float  # N/m
    coasting_time: float  # s
    turn_step: float  # rad
    top_speed: float  # m/s

    @classmethod
    def of(cls, body: Body) -> Motion:
        """Returns that of a body; raises `InputError` if it does not slide."""
        if not isinstance(body, SlidingBody):
            raise InputError(f"body {body.name!r}: expected a body that slides")
        contact = body.reach, body.mass * CONTACT_DAMPING, body.mass * CONTACT_STIFFNESS
        drive = body.damping, body.drive_gain, body.drive_speed, body.drive_force
        return cls(body.mass, *drive, *contact, body.coasting_time, body.turn_step, body.top_speed)


@compiled
def moved(
    motion: Motion,
    walls: np.ndarray,
    cell_size: float,
    x: float,
    y: float,
    vx: float,
    vy: float,
    yaw: float,
    action: int,
) -> tuple[float, float, float, float]:
    """Returns the position (m) and the velocity (m/s, on the map) after one action: x, y, vx, vy.

    `yaw` (rad) is the heading of a drive; a look action lets the body coast.
    """
    drives = action < len(BEARINGS)
    bearing = yaw + BEARINGS[action] if drives else 0.0
    along_x, along_y = math.cos(bearing), math.sin(bearing)
    for _ in range(STEPS_PER_ACTION):
        force, gain = 0.0, 0.0
        if drives:
            force, gain = motion.gain * (motion.drive_speed - vx * along_x - vy * along_y), motion.gain
        if force > motion.max_force:
            force, gain = motion.max_force, 0.0
        force_x, force_y = force * along_x - motion.damping * vx, force * along_y - motion.damping * vy
        push_x, push_y = push_of_walls(motion, walls, cell_size, x, y, vx, vy, force_x, force_y)
        # MuJoCo's integrator implicitfast takes the dampings of the next velocity, each axis by itself.
        damping_x, damping_y = motion.damping + gain * along_x**2, motion.damping + gain * along_y**2
        vx += PHYSICS_TIMESTEP * (force_x + push_x) / (motion.mass + PHYSICS_TIMESTEP * damping_x)
        vy += PHYSICS_TIMESTEP * (force_y + push_y) / (motion.mass + PHYSICS_TIMESTEP * damping_y)
        x, y = x + PHYSICS_TIMESTEP * vx, y + PHYSICS_TIMESTEP * vy
    return x, y, vx, vy


def moved_in_the_open(
    motion: Motion, vx: float, vy: float, yaw: float, action: int
) -> tuple[float, float, float, float]:
    """Returns what `moved` does where no wall is near, with a position (m) since the action began."""
    return moved(motion, NO_WALLS, 1.0, 0.0, 0.0, vx, vy, yaw, action)


@inlined
def push_of_walls(
    motion: Motion,
    walls: np.ndarray,
    cell_size: float,
    x: float,
    y: float,
    vx: float,
    vy: float,
    force_x: float,
    force_y: float,
) -> tuple[float, float]:
    """Returns the force (x, y) of the walls around a cell on a body that moves and is driven so."""
    # The neighbours at the nearer sides of the cell, and how far away these sides are.
    last = len(walls) - 2  # a body that was put into the border is pushed as one beside it
    column, row = min(max(int(x / cell_size), 1), last), min(max(int(y / cell_size), 1), last)
    from_left, from_below = x - column * cell_size, y - row * cell_size
    side_x, side_y = (1 if 2 * from_left > cell_size else -1), (1 if 2 * from_below > cell_size else -1)
    gap_x, gap_y = min(from_left, cell_size - from_left), min(from_below, cell_size - from_below)
    if gap_x >= motion.reach and gap_y >= motion.reach:
        return 0.0, 0.0
    beside, above = walls[column + side_x, row], walls[column, row + side_y]
    if beside or above:
        push_x = _contact_force(motion, motion.reach - gap_x, side_x * vx, side_x * force_x) if beside else 0.0
        push_y = _contact_force(motion, motion.reach - gap_y, side_y * vy, side_y * force_y) if above else 0.0
        return -side_x * push_x, -side_y * push_y
    if not walls[column + side_x, row + side_y]:
        return 0.0, 0.0
    # At a corner, a wall pushes along the line from the body to the corner.
    distance = max(math.hypot(gap_x, gap_y), 1e-9)
    to_x, to_y = side_x * gap_x / distance, side_y * gap_y / distance
    push = _contact_force(motion, motion.reach - distance, vx * to_x + vy * to_y, force_x * to_x + force_y * to_y)
    return -push * to_x, -push * to_y


@inlined
def _contact_force(motion: Motion, depth: float, speed: float, force: float) -> float:
    """Returns the force of a wall that the body is in by `depth`, with a speed and a force towards the wall."""
    if depth <= 0:
        return 0.0
    push = motion.contact_damping * speed + motion.contact_stiffness * depth + force
    return max(IMPEDANCE * push, 0.0)
