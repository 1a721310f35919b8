"""The agent `costmap-dwa`: what a robot with Nav2 does, with the pose as it is observed."""

from __future__ import annotations

import dataclasses
import math
import pathlib
from typing import Self

import numpy as np

from mazebench.agent import Agent, Inputs, Interface
from mazebench.constants import FORWARD_VELOCITY, STEP_TIME, YAW, YAW_RATE, X, Y
from mazebench.errors import UnplayableError
from mazebench.tasks.context import GLOBAL_MAP, GOAL
from mazebench.world.angles import wrap_angle
from mazebench.world.bodies import Body
from mazebench.world.ray_casting import LidarModel

from ..robot.cells import marked_cell
from .costmap import INFLATION, Costmap
from .global_planner import cheapest_path
from .window import Limits, best_velocities

_PLAN_EVERY = round(1 / STEP_TIME)  # steps
_HORIZON, _FARTHEST = 1.2, 1.2  # s for which it drives in advance, and the most m
_LOCAL_GOAL = 1.3  # times as far as it drives in advance is the local goal on the path
_NEAREST_GOAL = 0.6  # m, at least
# m or rad that it should move or turn in so many steps, by Nav2's progress checker, which takes 10 s.
_MOVED, _STUCK = 0.5, round(5 / STEP_TIME)
_MARGIN = 0.02  # m between the robot and the distance at which walls push it
_STANDING = 0.02  # m/s
# Recoveries as those of Nav2's behaviour trees: rad of a turn, and m and m/s of backing up.
_TURN, _BACK, _BACKWARD = math.pi / 2, 0.3, 0.15


def limits_of(body: Body) -> Limits:
    """Returns what a body can do; accelerations are those with which it would come to rest as far away as it does."""
    speed, rate = body.top_speed, body.turn_rate
    turn = body.rest_turn(rate)
    turn_acceleration = rate**2 / (2 * turn) if turn else rate / STEP_TIME * 2  # at once
    horizon = min(_HORIZON, _FARTHEST / speed)
    acceleration = speed / (2 * body.rest_time(speed))
    return Limits(speed, rate, acceleration, turn_acceleration, body.reach + _MARGIN, horizon, body.radius)


@dataclasses.dataclass
class _Robot:
    """The memory of the robot in one environment."""

    costmap: Costmap
    goal: tuple[float, float] = (0.0, 0.0)  # m
    path: np.ndarray | None = None  # [K, 2] float, m; None if there is none
    until_plan: int = 0  # steps
    recovery: list[tuple[float, float]] = dataclasses.field(default_factory=list)  # its actions that are left
    since_moved: int = 0  # steps
    moved_from: tuple[float, float, float] = (math.inf, math.inf, 0.0)  # m, rad


class CostmapDWA(Agent):
    """Marks and clears walls by lidar, plans each second, and drives the best velocities of its dynamic window."""

    plays_actions = ("diff",)
    needs_sensors = ("lidar",)
    needs_shown = ("goal",)

    def __init__(self, interface: Interface):
        """Raises `UnplayableError` if the pose is odometry, by which it can't find its place on the map."""
        if interface.odometry_noise > 0:
            raise UnplayableError("agent 'costmap-dwa': expected the pose on the map, found odometry with noise")
        if interface.sensors:
            interface.require_sensor("lidar", "costmap-dwa")
        self._reach = (interface.lidar or LidarModel()).max_range
        self._width = interface.size * interface.cell_size
        self._limits, self._offset = limits_of(interface.body), interface.body.lidar_offset

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> Self:
        """Returns an agent for the interface's mazes."""
        return cls(interface)

    @classmethod
    def context_size(cls, size: int) -> int:
        """Returns N: the map at full resolution."""
        return size

    @classmethod
    def read_sensors(cls, sensors: tuple[str, ...]) -> tuple[str, ...]:
        """Returns the lidar, if it is among them."""
        return tuple(name for name in sensors if name == "lidar")

    def initial_state(self, batch_size: int) -> list[_Robot | None]:
        """Returns no robots yet: one is made where an episode begins."""
        return [None] * batch_size

    def act(
        self, inputs: Inputs, state: list[_Robot | None], explore: bool = False
    ) -> tuple[np.ndarray, list[_Robot | None]]:
        """Returns actions `[B, 2]`, for one environment after the other."""
        actions = np.zeros((len(state), 2))
        for slot in range(len(state)):
            if inputs.active is not None and not inputs.active[slot]:
                continue
            robot, context = state[slot], inputs.observation["context"][slot]
            if robot is None or inputs.new_episode[slot]:
                robot = state[slot] = _Robot(Costmap(context[GLOBAL_MAP], self._width))
            if inputs.new_context[slot]:
                self._begin_leg(robot, context)
            values = inputs.observation["state"][slot].astype(np.float64)
            ranges = inputs.observation["lidar"][slot].astype(np.float64)
            actions[slot] = self._drive(robot, values, ranges)
        return actions, state

    def _begin_leg(self, robot: _Robot, context: np.ndarray) -> None:
        robot.costmap.read(context[GLOBAL_MAP])
        (row, column), pixel = marked_cell(context[GOAL]), self._width / len(context[GOAL])
        robot.goal, robot.until_plan = ((column + 0.5) * pixel, self._width - (row + 0.5) * pixel), 0

    def _drive(self, robot: _Robot, values: np.ndarray, ranges: np.ndarray) -> tuple[float, float]:
        """Returns the action after a state `[12]` and a scan `[R]`."""
        x, y = (min(max(float(values[axis]), 0.01), self._width - 0.01) for axis in (X, Y))
        yaw, limits = float(values[YAW]), self._limits
        lidar_x, lidar_y = x + self._offset * math.cos(yaw), y + self._offset * math.sin(yaw)
        robot.costmap.sense(lidar_x, lidar_y, yaw, ranges, self._reach)

        if robot.recovery:
            return robot.recovery.pop()
        robot.since_moved += 1
        x_then, y_then, yaw_then = robot.moved_from
        if max(math.dist((x_then, y_then), (x, y)), abs(wrap_angle(yaw - yaw_then))) > _MOVED:
            robot.moved_from, robot.since_moved = (x, y, yaw), 0

        # The global plan, each second.
        if robot.until_plan <= 0:
            robot.path, robot.until_plan = self._plan(robot, x, y), _PLAN_EVERY
        robot.until_plan -= 1
        if robot.path is None:
            robot.costmap.forget()
            return self._recover(robot, backs=False)

        # The local plan: velocities along the next part of the path.
        way = limits.horizon * limits.top_speed
        count = max(1, round(max(_NEAREST_GOAL, _LOCAL_GOAL * way) / robot.costmap.cell))
        nearest = int(np.hypot(*(robot.path[: 2 * count] - (x, y)).T).argmin())
        clearance, left, upper, cell = robot.costmap.clearance_around(x, y, way + INFLATION + limits.radius)
        speed, rate, is_any, is_near = best_velocities(
            limits, (x, y, yaw), (float(values[FORWARD_VELOCITY]), float(values[YAW_RATE])),
            robot.path[nearest : nearest + count], clearance, (left, upper), cell,
        )  # fmt: skip
        if robot.since_moved > _STUCK:
            return self._recover(robot, is_near)
        if not is_any:  # it brakes first
            is_standing = abs(values[FORWARD_VELOCITY]) < _STANDING
            return self._recover(robot, is_near) if is_standing else (0.0, 0.0)
        return speed / limits.top_speed, rate / limits.turn_rate

    def _plan(self, robot: _Robot, x: float, y: float) -> np.ndarray | None:
        """Returns the points of a cheapest path `[K, 2]`, m; None if there is none."""
        cell, clearance = robot.costmap.cell, robot.costmap.clearance()
        start, goal = ((len(clearance) - 1 - int(b / cell), int(a / cell)) for a, b in ((x, y), robot.goal))
        cells = cheapest_path(clearance, cell, self._limits.radius, start, goal)
        if len(cells) == 0:
            return None
        return np.stack([(cells[:, 1] + 0.5) * cell, self._width - (cells[:, 0] + 0.5) * cell], axis=1)

    def _recover(self, robot: _Robot, backs: bool) -> tuple[float, float]:
        """Returns the first action of a recovery, which backs up or turns on the spot; then it plans again."""
        limits = self._limits
        speed = min(_BACKWARD, limits.top_speed)
        num_steps = math.ceil((_BACK / speed if backs else _TURN / limits.turn_rate) / STEP_TIME)
        robot.recovery = [(-speed / limits.top_speed, 0.0) if backs else (0.0, 1.0)] * num_steps
        robot.since_moved = robot.until_plan = 0
        return robot.recovery.pop()
