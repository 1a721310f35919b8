"""The body's motion: one agent step of the world's physics, without MuJoCo.

The body has a mass of 1 kg. A drive pulls it in one direction, against damping. Walls push it off by MuJoCo's soft
contacts, without friction. mazebench/world/mjcf.py has the constants. A map is `[N, N]` bool here, indexed by x and y.
"""

from __future__ import annotations

import math

import numpy as np

from mazebench.constants import PHYSICS_TIMESTEP, STEPS_PER_ACTION, TOP_SPEED
from mazebench.kernels import compiled, inlined

REACH = 0.18  # m from the body's centre at which walls begin to push: its radius and the margin of contacts
_NO_WALLS = np.zeros((3, 3), dtype=bool)
_DAMPING, _GAIN, _MAX_FORCE = 8.0, 60.0, 34.0
_DRIVE_SPEED = TOP_SPEED * (1 + _DAMPING / _GAIN)
BEARINGS = np.array([0.0, math.pi, math.pi / 2, -math.pi / 2])  # of the four drives, from the heading
# Of a contact, computed from its time constant of 2 timesteps and its damping ratio of 3, as MuJoCo's documentation
# of solref has it, for an impedance of 0.95.
_IMPEDANCE = 0.95
_CONTACT_DAMPING = 2 / (_IMPEDANCE * 2 * PHYSICS_TIMESTEP)
_CONTACT_STIFFNESS = (_CONTACT_DAMPING / (2 * 3.0)) ** 2


@compiled
def moved(
    walls: np.ndarray, cell_size: float, x: float, y: float, vx: float, vy: float, yaw: float, action: int
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
            force, gain = _GAIN * (_DRIVE_SPEED - vx * along_x - vy * along_y), _GAIN
        if force > _MAX_FORCE:
            force, gain = _MAX_FORCE, 0.0
        force_x, force_y = force * along_x - _DAMPING * vx, force * along_y - _DAMPING * vy
        push_x, push_y = _push(walls, cell_size, x, y, vx, vy, force_x, force_y)
        # MuJoCo's integrator implicitfast takes the dampings of the next velocity, each axis by itself.
        vx += PHYSICS_TIMESTEP * (force_x + push_x) / (1 + PHYSICS_TIMESTEP * (_DAMPING + gain * along_x**2))
        vy += PHYSICS_TIMESTEP * (force_y + push_y) / (1 + PHYSICS_TIMESTEP * (_DAMPING + gain * along_y**2))
        x, y = x + PHYSICS_TIMESTEP * vx, y + PHYSICS_TIMESTEP * vy
    return x, y, vx, vy


def moved_in_the_open(vx: float, vy: float, yaw: float, action: int) -> tuple[float, float, float, float]:
    """Returns what `moved` does where no wall is near, with a position (m) since the action began."""
    return moved(_NO_WALLS, 1.0, 0.0, 0.0, vx, vy, yaw, action)


@inlined
def _push(
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
    if gap_x >= REACH and gap_y >= REACH:
        return 0.0, 0.0
    beside, above = walls[column + side_x, row], walls[column, row + side_y]
    if beside or above:
        push_x = _contact_force(REACH - gap_x, side_x * vx, side_x * force_x) if beside else 0.0
        push_y = _contact_force(REACH - gap_y, side_y * vy, side_y * force_y) if above else 0.0
        return -side_x * push_x, -side_y * push_y
    if not walls[column + side_x, row + side_y]:
        return 0.0, 0.0
    # At a corner, a wall pushes along the line from the body to the corner.
    distance = max(math.hypot(gap_x, gap_y), 1e-9)
    to_x, to_y = side_x * gap_x / distance, side_y * gap_y / distance
    push = _contact_force(REACH - distance, vx * to_x + vy * to_y, force_x * to_x + force_y * to_y)
    return -push * to_x, -push * to_y


@inlined
def _contact_force(depth: float, speed: float, force: float) -> float:
    """Returns the force of a wall that the body is in by `depth`, with a speed and a force towards the wall."""
    if depth <= 0:
        return 0.0
    return max(_IMPEDANCE * (_CONTACT_DAMPING * speed + _CONTACT_STIFFNESS * depth + force), 0.0)
