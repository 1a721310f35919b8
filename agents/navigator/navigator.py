"""The navigator: estimates its pose and the map, plans over both, and drives."""

from __future__ import annotations

import dataclasses
import math
import pathlib
from typing import Self

import numpy as np
from scipy import ndimage

from mazebench.agent import Agent, Inputs, Interface
from mazebench.errors import InputError
from mazebench.maps.maze import Cell, cell_to_point
from mazebench.world.lidar import MAX_RANGE

from ..common.bounds import bounded
from ..robot.body import LOOK_LEFT, Body, observed_body
from ..robot.cells import nearest_cell
from ..robot.pilot import steer
from . import driving
from .exploration import disambiguate
from .map_reading import MapReading, read_map
from .occupancy import Occupancy
from .planning import plan
from .pose import PoseEstimate, known_position

_LARGEST_MISALIGNMENT = math.radians(15)  # more makes more contacts, less costs time: a turn is one of 21 degrees
_BLOCKED = 0.5  # probability of a wall from which driving keeps clear of a cell off the path
_MARK_OFF = 1.0  # cells, standard deviation of the goal from its mark, once it was not there


@dataclasses.dataclass
class _Memory:
    """What the navigator knows in one environment."""

    reading: MapReading
    occupancy: Occupancy
    pose: PoseEstimate
    searched: np.ndarray  # [N, N] bool, the cells that the body was in, so that the goal is elsewhere
    walls: np.ndarray  # [N, N] float, the probability of a wall, as of the last action
    telling: list[Cell] = dataclasses.field(default_factory=list)  # a path to where the pose will be clearer

    @property
    def cell(self) -> Cell:
        """The cell of the body."""
        return nearest_cell(self.pose.body.x, self.pose.body.y, len(self.searched))

    def forget(self) -> None:
        """Drops what was seen, because it was seen from elsewhere than believed."""
        self.occupancy = Occupancy.of_map(self.reading.walls, self.occupancy.reach)
        self.searched[:] = False
        self.telling = []


class Navigator(Agent):
    """A classical robot: it localizes itself, maps what it sees, plans again at each step, and pursues its path.

    It measures lengths in cells.
    """

    needs_sensors = ("lidar",)

    def __init__(self, size: int, cells_per_metre: float = 1.0):
        """Acts in mazes of `size` cells a side."""
        self._size, self._cells_per_metre = size, cells_per_metre
        self._ray_scale = np.float32(cells_per_metre)  # as exact as the sensor

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> Self:
        """Returns a navigator for the interface's mazes.

        Raises:
          InputError: if the environments have no lidar.
        """
        if "lidar" not in interface.sensors:
            raise InputError("navigator needs the sensor lidar; give the interface sensors=('lidar',)")
        return cls(interface.size, 1 / interface.cell_size)

    @classmethod
    def context_size(cls, size: int) -> int:
        """Returns N: the map at full resolution."""
        return size

    def initial_state(self, batch_size: int) -> list[_Memory | None]:
        """Returns empty memories, which `act` replaces where an episode begins."""
        return [None] * batch_size

    def act(
        self, inputs: Inputs, state: list[_Memory | None], explore: bool = False
    ) -> tuple[np.ndarray, list[_Memory | None]]:
        """Returns actions `[B]`, for one environment after the other."""
        inputs = bounded(inputs)
        actions = np.zeros(len(state), dtype=np.int64)
        for slot, values in enumerate(inputs.observation["state"].tolist()):
            if inputs.active is not None and not inputs.active[slot]:
                continue
            context, ranges = inputs.observation["context"][slot], self._ray_scale * inputs.observation["lidar"][slot]
            observed, memory = observed_body(values, self._cells_per_metre), state[slot]
            if memory is None or inputs.new_episode[slot]:
                memory = state[slot] = self._begin(context, observed, ranges)
            else:
                if inputs.new_context[slot]:
                    memory.reading = read_map(context, self._size)
                    memory.searched[:] = False
                if memory.pose.update(memory.reading, memory.walls > 0.5, observed, ranges):
                    memory.forget()
            actions[slot] = _act(memory, ranges, self._cells_per_metre)
        return actions, state

    def _begin(self, context: np.ndarray, observed: Body, ranges: np.ndarray) -> _Memory:
        """Returns what is known after an episode's first observation."""
        reading = read_map(context, self._size, known_position(observed))
        reach = float(self._ray_scale * np.float32(MAX_RANGE))
        pose = PoseEstimate.begin(reading, observed, ranges, reach)
        searched = np.zeros((self._size, self._size), dtype=bool)
        return _Memory(reading, Occupancy.of_map(reading.walls, reach), pose, searched, reading.walls)


def _act(memory: _Memory, ranges: np.ndarray, cells_per_metre: float) -> int:
    """Returns the action after a scan `ranges` `[32]`, which is added to what was seen."""
    body = memory.pose.body
    # From a wrong pose, walls are seen in the frame of that pose. `forget` drops them if another pose takes its place.
    memory.occupancy.see(body.x, body.y, body.yaw, ranges, memory.pose.deviation)
    walls = memory.walls = memory.occupancy.probability()
    path = _telling_path(memory) or _path_to_goal(memory)
    if not path:
        return LOOK_LEFT  # which comes to rest, and waits
    points = cell_to_point(np.array(path), len(walls))
    blocked = walls > _BLOCKED
    blocked[tuple(np.transpose(path))] = False
    rest_x, rest_y = body.rest()
    aim = driving.aim(blocked, points, rest_x, rest_y, cells_per_metre)
    return steer(body, aim, _LARGEST_MISALIGNMENT)


def _path_to_goal(memory: _Memory) -> list[Cell]:
    """Returns the cells to the goal, none if there is no cell left where it may be."""
    # The episode would have ended in the goal, and no goal is a wall.
    memory.searched[memory.cell] = True
    is_possible = ~(memory.searched | (memory.occupancy.is_seen() & (memory.walls > 0.5)))
    goal = memory.reading.goal * is_possible
    if not goal.any():
        goal = ndimage.gaussian_filter(memory.reading.goal, _MARK_OFF, mode="constant") * is_possible
    return plan(memory.walls, goal, memory.cell) if goal.any() else []


def _telling_path(memory: _Memory) -> list[Cell]:
    """Returns the cells to where the pose will be clearer; none if it is clear, or will not be so anywhere near."""
    if memory.pose.belief is None or memory.pose.is_certain:
        return []
    # It is driven to its end: another one from each cell and heading would have the body go to and fro.
    if memory.cell in memory.telling[:-1]:
        memory.telling = memory.telling[memory.telling.index(memory.cell) :]
    else:
        path = disambiguate(memory.pose.belief, memory.reading.walls > 0.5)
        memory.telling = path if len(path) > 1 else []
    return memory.telling
