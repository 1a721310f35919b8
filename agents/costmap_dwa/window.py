"""The dynamic window (Fox, Burgard & Thrun 1997): the best of the velocities that a robot can reach in one step.

Each one is driven for a while in advance, and judged by what DWB of Nav2 judges by: its distances to the path and to
the local goal, of the robot's middle and of a point ahead of it, and the cost of the costmap.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mazebench.constants import STEP_TIME
from mazebench.kernels import compiled

from .costmap import cost

_NUM_SPEEDS, _NUM_TURNS = 8, 21
_PATH, _GOAL, _HEADING, _NEAR_WALLS = 32.0, 24.0, 1.0, 5.0  # weights per m, per rad, and of the costmap's cost
_TARGET = 3  # points ahead on the path, to which it should head
_NEARER = 0.002  # m, by which a robot that is too near to a wall may come nearer


class Limits(NamedTuple):
    """The abilities of a robot."""

    top_speed: float  # m/s
    turn_rate: float  # rad/s
    acceleration: float  # m/s^2
    turn_acceleration: float  # rad/s^2
    radius: float  # m, to which no wall should come
    horizon: float  # s, for which it drives in advance
    ahead: float  # m, at which a point of its nose is


@compiled
def best_velocities(
    limits: Limits,
    pose: tuple[float, float, float],
    velocities: tuple[float, float],
    path: np.ndarray,
    clearance: np.ndarray,
    corner: tuple[float, float],
    cell: float,
) -> tuple[float, float, bool, bool]:
    """Returns speed (m/s), yaw rate (rad/s), whether there are any that meet no wall, and whether a wall is too near.

    Args:
      limits: of the robot.
      pose: x, y (m) and yaw (rad).
      velocities: speed and yaw rate now.
      path: `[K, 2]` float, points (m) from the nearest one to the local goal.
      clearance: `[H, W]` float, m to the nearest wall, around the robot.
      corner: m, its left and upper end.
      cell: m.
    """
    speed = min(max(velocities[0], 0.0), limits.top_speed)
    rate = min(max(velocities[1], -limits.turn_rate), limits.turn_rate)
    gain, twist = limits.acceleration * STEP_TIME, limits.turn_acceleration * STEP_TIME
    slowest, fastest = max(0.0, speed - gain), min(limits.top_speed, speed + gain)
    right, left = max(-limits.turn_rate, rate - twist), min(limits.turn_rate, rate + twist)
    num_steps = max(8, math.ceil(limits.horizon * limits.top_speed / cell))
    step = limits.horizon / num_steps
    here = _clearance_at(clearance, corner, cell, pose[0], pose[1])
    needed = min(limits.radius, here - _NEARER)
    least, best_speed, best_rate, is_any = np.inf, 0.0, 0.0, False
    for i in range(_NUM_SPEEDS):
        for j in range(_NUM_TURNS):
            v = slowest + (fastest - slowest) * i / (_NUM_SPEEDS - 1)
            w = right + (left - right) * j / (_NUM_TURNS - 1)
            x, y, yaw = pose
            near, is_free = here, True
            stopping = STEP_TIME + v / (2 * limits.acceleration)
            for k in range(num_steps):
                yaw_then = yaw + w * step
                x_then = x + v * step * math.cos(yaw + w * step / 2)
                y_then = y + v * step * math.sin(yaw + w * step / 2)
                clear = _clearance_at(clearance, corner, cell, x_then, y_then)
                if clear < needed:
                    is_free = k * step > stopping
                    near = limits.radius
                    break
                x, y, yaw, near = x_then, y_then, yaw_then, min(near, clear)
            if not is_free:
                continue
            nose_x, nose_y = x + limits.ahead * math.cos(yaw), y + limits.ahead * math.sin(yaw)
            off, left_of_path = _to_path(path, x, y)
            nose_off, nose_left = _to_path(path, nose_x, nose_y)
            near_walls = cost(near, limits.radius)
            target_x, target_y = path[min(_TARGET, len(path) - 1)]
            heading = abs((math.atan2(target_y - y, target_x - x) - yaw + math.pi) % (2 * math.pi) - math.pi)
            score = _PATH * (off + nose_off) + _GOAL * (left_of_path + nose_left) + _NEAR_WALLS * near_walls
            score += _HEADING * heading
            if score < least:
                least, best_speed, best_rate, is_any = score, v, w, True
    return best_speed, best_rate, is_any, here < limits.radius


@compiled
def _clearance_at(clearance: np.ndarray, corner: tuple[float, float], cell: float, x: float, y: float) -> float:
    # Between the middles of four cells.
    down, right = (corner[1] - y) / cell - 0.5, (x - corner[0]) / cell - 0.5
    down, right = min(max(down, 0.0), clearance.shape[0] - 1.001), min(max(right, 0.0), clearance.shape[1] - 1.001)
    row, column = int(down), int(right)
    down, right = down - row, right - column
    upper = (1 - right) * clearance[row, column] + right * clearance[row, column + 1]
    lower = (1 - right) * clearance[row + 1, column] + right * clearance[row + 1, column + 1]
    return (1 - down) * upper + down * lower - cell / 2


@compiled
def _to_path(path: np.ndarray, x: float, y: float) -> tuple[float, float]:
    """Returns the m from a point to the nearest one of a path, and those along the path from there to its end."""
    x_then, y_then = path[0]
    nearest, passed_there, passed = math.hypot(x - x_then, y - y_then), 0.0, 0.0
    for k in range(1, len(path)):
        along_x, along_y = path[k, 0] - x_then, path[k, 1] - y_then
        length = math.hypot(along_x, along_y)
        share = min(max(((x - x_then) * along_x + (y - y_then) * along_y) / length**2, 0.0), 1.0)
        off = math.hypot(x_then + share * along_x - x, y_then + share * along_y - y)
        if off < nearest:
            nearest, passed_there = off, passed + share * length
        passed += length
        x_then, y_then = path[k]
    return nearest, passed - passed_there
