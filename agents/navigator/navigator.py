"""The navigator: a classical robot that plans over what it knows of walls and goal, and drives, anew at each step."""

from __future__ import annotations

import dataclasses
import pathlib
from typing import ClassVar, Self

import numpy as np

from mazebench.agent import Agent, Inputs, Interface, Report
from mazebench.maps.maze import Cell

from ..robot.driving import Drive
from ..robot.facing import TurningDrive
from ..robot.map_reading import map_reader
from ..robot.moving_body import PLAYED, as_kind, has_all_six
from ..robot.planning import plan
from ..robot.senses import Memory, Senses, range_sensor, report
from .passages import Passages


@dataclasses.dataclass
class Robot:
    """The robot in one environment: what it knows, and the drive that is under way."""

    memory: Memory
    passages: Passages | None = None  # where it may wait for some to open
    drive: Drive = dataclasses.field(default_factory=Drive)
    turning: TurningDrive = dataclasses.field(init=False)

    def __post_init__(self) -> None:
        self.turning = TurningDrive(self.memory.body.yaw)


class Navigator(Agent):
    """Localizes itself, maps the walls that it senses, plans over walls and goal, and drives, all at each step."""

    plays_actions = PLAYED
    senses_class: ClassVar[type[Senses]] = Senses
    read_sensors = staticmethod(range_sensor)
    map_reader = staticmethod(map_reader)
    waits: ClassVar[bool] = True  # for passages to open, once it has seen one change

    def __init__(self, interface: Interface):
        """Acts in the environments of the interface, with their lidar if they have one."""
        self._senses, self._cell_size = self.senses_class(interface, "navigator"), interface.cell_size
        self._turns = interface.actions == "velocity" and self._senses.is_narrow
        self._kind, self._body = interface.actions, interface.body
        self._strafes = has_all_six(self._kind, self._body)

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> Self:
        """Returns an agent for the interface's mazes."""
        return cls(interface)

    @classmethod
    def context_size(cls, size: int) -> int:
        """Returns N: the map at full resolution."""
        return size

    def initial_state(self, batch_size: int) -> list[Robot | None]:
        """Returns no robots yet: one is made where an episode begins."""
        return [None] * batch_size

    def act(
        self, inputs: Inputs, state: list[Robot | None], explore: bool = False
    ) -> tuple[np.ndarray, list[Robot | None]]:
        """Returns actions `[B]`, for one environment after the other."""
        actions = np.zeros(len(state), dtype=np.int64)
        velocities = np.zeros((len(state), 3))  # of robots that turn as they drive
        inputs = self._senses.look(inputs)
        for slot, robot in enumerate(state):
            if inputs.active is None or inputs.active[slot]:
                memory = self._senses.observe(robot.memory if robot else None, inputs, slot)
                if robot is None or robot.memory is not memory:
                    robot = state[slot] = self.begin(memory, inputs.seed.item(slot))
                elif robot.passages is not None:
                    robot.passages.update(memory)

                # A path over walls and goal as they are estimated now.
                walls, goal = self.estimate(robot, inputs, slot)
                closed = None if robot.passages is None else robot.passages.costs(memory)
                path = self.find_path(robot, walls, goal, closed)

                # It drives along the path, and waits where there is none.
                if self._turns:
                    velocities[slot] = robot.turning.follow(path, walls, memory)
                else:
                    actions[slot] = robot.drive.follow(path, walls, memory, self._strafes)
        return velocities if self._turns else as_kind(self._kind, actions, self._body), state

    def begin(self, memory: Memory, seed: int) -> Robot:
        """Returns the robot of an episode, whose random draws come from `seed`."""
        return Robot(memory, self._passages(memory))

    def find_path(self, robot: Robot, walls: np.ndarray, goal: np.ndarray, closed: np.ndarray | None) -> list[Cell]:
        """Returns the cells of the path from the robot's cell, none where it waits or knows no goal.

        `walls` and `goal` are as in `estimate`, and `closed` the costs of closed passages, if some have changed.
        """
        cell = robot.memory.cell
        path = plan(walls, goal, cell, self._cell_size, closed) if goal.any() else []
        if closed is not None:  # as far as the first closed passage
            path = path[: int(np.argmax([closed[each] < np.inf for each in path] + [True]))]
            path = path if len(path) > 1 or goal[cell] else []
        return path

    def _passages(self, memory: Memory) -> Passages | None:
        """Returns what a robot sees of passages; None where it does not wait for them, or its pose may be wrong."""
        knows_pose = memory.tracker is None and memory.dead_reckoning is None
        return Passages(memory) if self.waits and knows_pose and not self._senses.feels and not self._turns else None

    def estimate(self, robot: Robot, inputs: Inputs, slot: int) -> tuple[np.ndarray, np.ndarray]:
        """Returns what it plans on, `[L, L]` float twice: the probability of a wall, and weights of the goal."""
        return robot.memory.estimate()

    def report(self, state: list[Robot | None]) -> Report:
        """Returns where the robots are on the maps, by the likeliest way in which these may lie."""
        return report(robot.memory if robot else None for robot in state)
