"""The navigator: estimates its pose and the map, plans over both, and drives."""

from __future__ import annotations

import dataclasses
import pathlib
from typing import Self

import numpy as np
from scipy import ndimage

from mazebench.agent import Agent, Inputs, Interface
from mazebench.errors import InputError
from mazebench.maps.maze import Cell, cell_to_point
from mazebench.tasks.context import START
from mazebench.world.lidar import LidarModel

from ..common.bounds import bounded
from ..robot.beams import Beams, beams_of
from ..robot.body import LOOK_LEFT, LOOK_RIGHT, TURN_STEP, Body, Point, observed_body
from ..robot.cells import nearest_cell
from ..robot.map_matching import MapBelief
from ..robot.occupancy import Occupancy
from ..robot.odometry import DeadReckoning
from ..robot.pilot import steer
from ..robot.tracking import Tracker, aligned
from .driving import Drive
from .map_reading import read_map
from .planning import plan

_BLOCKED = 0.35  # probability of a wall from which driving keeps clear of a cell off the path
_MARK_OFF = 1.0  # cells, standard deviation of the goal from its mark, once it was not there
# Cells, which are taken for 1 m wide.
_EXACT, _TRACKED = 0.01, 0.03  # standard deviations of a position that is observed, and of one that is tracked
_ROUNDING = 1e-4  # of positions as float32


@dataclasses.dataclass
class _Memory:
    """What the navigator knows in one environment.

    All is on one grid of L x L cells: the maze where the pose is known, else one around the start.
    """

    occupancy: Occupancy
    belief: MapBelief  # of how the map lies on the occupancy grid
    prior: np.ndarray  # [L, L] float, the probability of a wall by the map
    goal: np.ndarray  # [L, L] float, the probability of the goal
    body: Body  # on the grid
    tracker: Tracker | None  # None where the pose is observed
    dead_reckoning: DeadReckoning | None  # where observed positions are noisy
    searched: np.ndarray  # [L, L] bool, the cells that the body was in, so that the goal is elsewhere
    drive: Drive = dataclasses.field(default_factory=Drive)  # the one that is under way
    commanded: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))  # the pose after the last action

    @property
    def cell(self) -> Cell:
        """The cell of the body."""
        return nearest_cell(self.body.x, self.body.y, len(self.searched))


class Navigator(Agent):
    """A classical robot: it localizes itself, maps what it sees, plans again at each step, and pursues its path.

    It measures lengths in cells.
    """

    needs_sensors = ("lidar",)

    def __init__(self, size: int, cells_per_metre: float = 1.0, model: LidarModel | None = None, noise: float = 0.0):
        """Acts in mazes of `size` cells a side; `model` is the lidar's, and `noise` the odometry's alpha."""
        self._size, self._cells_per_metre, self._noise = size, cells_per_metre, noise
        self._beams = beams_of(model or LidarModel(), cells_per_metre)

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> Self:
        """Returns a navigator for the interface's mazes.

        Raises:
          InputError: if the environments have no lidar.
        """
        if "lidar" not in interface.sensors:
            raise InputError("navigator needs the sensor lidar; give the interface sensors=('lidar',)")
        return cls(interface.size, 1 / interface.cell_size, interface.lidar, interface.odometry_noise)

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
        scans = np.minimum(self._cells_per_metre * inputs.observation["lidar"].astype(np.float64), self._beams.reach)
        for slot, values in enumerate(inputs.observation["state"].tolist()):
            if inputs.active is not None and not inputs.active[slot]:
                continue
            context, ranges = inputs.observation["context"][slot], scans[slot]
            observed, memory = observed_body(values, self._cells_per_metre), state[slot]
            if memory is None or inputs.new_episode[slot]:
                memory = state[slot] = self._begin(context, observed, ranges)
            else:
                if inputs.new_context[slot]:
                    self._begin_leg(memory, context)
                _move(memory, observed, ranges, self._beams)
            actions[slot] = self._act(memory, ranges)
        return actions, state

    def _begin(self, context: np.ndarray, observed: Body, ranges: np.ndarray) -> _Memory:
        """Returns what is known after an episode's first observation."""
        known = _known_position(observed)
        reading = read_map(context, self._size, known)
        pose, odometry, middle, dead_reckoning = _pose(observed), _pose(observed), None, None
        if known is not None:
            # The grid is the maze. A start that is known but not marked says that the sheet may lie in any way.
            size, num_turns = self._size, 1 if context[START].any() else 8
        else:
            # The grid has the start in its middle, and the axes of the maze or of the first scan.
            size, middle = 2 * self._size - 1, reading.start
            if odometry.any():
                pose[:2], num_turns = self._size - 0.5, 1
                dead_reckoning = DeadReckoning((observed.x, observed.y), observed.velocity())
            else:
                unseen = Occupancy.unseen(size).seen_walls()
                pose, num_turns = aligned(unseen, self._size - 0.5, self._size - 0.5, ranges, self._beams), 4
        is_tracked = known is None or self._noise > 0
        belief = MapBelief.begin(reading.walls, reading.goal, num_turns, middle, size)
        prior, goal = belief.mixture()
        x, y, yaw = pose.tolist()
        return _Memory(
            occupancy=Occupancy.unseen(size),
            belief=belief,
            prior=prior,
            goal=goal,
            body=observed._replace(x=x, y=y, yaw=yaw),
            tracker=Tracker(pose, odometry, self._noise) if is_tracked else None,
            dead_reckoning=dead_reckoning,
            searched=np.zeros((size, size), dtype=bool),
        )

    def _begin_leg(self, memory: _Memory, context: np.ndarray) -> None:
        """Takes in the map and the goal of another leg."""
        reading = read_map(context, self._size)
        memory.belief = memory.belief.on_leg(reading.walls, reading.goal)
        memory.prior, memory.goal = memory.belief.mixture()
        memory.searched[:] = False

    def _act(self, memory: _Memory, ranges: np.ndarray) -> int:
        """Returns the action after a scan `ranges` `[32]`, which is added to what was seen."""
        body = memory.body
        deviation = _EXACT if memory.tracker is None else _TRACKED
        memory.occupancy.see((body.x, body.y, body.yaw), ranges, self._beams, deviation)
        # The episode would have ended in the goal. Near a cell's border, the body may be in another one.
        off_x, off_y = (abs(coordinate % 1.0 - 0.5) for coordinate in (body.x, body.y))
        if max(off_x, off_y) < 0.5 - 2 * deviation:
            memory.searched[memory.cell] = True
        if memory.belief.update(memory.occupancy.evidence, memory.searched):
            memory.prior, memory.goal = memory.belief.mixture()
        walls = memory.occupancy.walls(memory.prior)
        path = _path_to_goal(memory, walls)
        action, point = LOOK_LEFT, body.rest()  # where there is no way, it waits
        if len(path) == 1:
            action = steer(body, tuple(cell_to_point(path[0], len(walls)).tolist()))
        elif path:
            blocked = walls > _BLOCKED
            blocked[tuple(np.transpose(path))] = False
            action, point = memory.drive.next(blocked, path, body, 1 / self._cells_per_metre)
        turn = TURN_STEP * ((action == LOOK_LEFT) - (action == LOOK_RIGHT))
        memory.commanded = np.array([*point, body.yaw + turn])
        return action


def _pose(body: Body) -> np.ndarray:
    """Returns x, y and yaw as `[3]` float."""
    return np.array([body.x, body.y, body.yaw])


def _known_position(observed: Body) -> Point | None:
    """Returns where on the map an episode begins, if the first state tells it: then it is the centre of a cell."""
    off_centre = max(abs(coordinate % 1.0 - 0.5) for coordinate in (observed.x, observed.y))
    return (observed.x, observed.y) if off_centre < _ROUNDING else None


def _move(memory: _Memory, observed: Body, ranges: np.ndarray, beams: Beams) -> None:
    """Takes in the body as it is observed one step on."""
    if memory.tracker is None:
        memory.body = observed
        return
    odometry = observed if memory.dead_reckoning is None else memory.dead_reckoning.update(observed)
    memory.tracker.update(memory.occupancy.seen_walls(), _pose(odometry), memory.commanded, ranges, beams)
    memory.body = memory.tracker.body(observed)


def _path_to_goal(memory: _Memory, walls: np.ndarray) -> list[Cell]:
    """Returns the cells to the goal, which is no wall; none if there is no cell left where it may be."""
    is_possible = ~(memory.searched | (memory.occupancy.is_seen() & (walls > 0.5)))
    goal = memory.goal * is_possible
    if not goal.any():
        goal = ndimage.gaussian_filter(memory.goal, _MARK_OFF, mode="constant") * is_possible
    return plan(walls, goal, memory.cell) if goal.any() else []
