"""A robot that localizes itself, maps what it senses, and drives along a path that it plans anew at each step.

What it believes of walls and goal is given to it: by the rule `believed_by_rule`, or by a network. It measures lengths
in cells.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy import ndimage

from mazebench.agent import Inputs, Interface
from mazebench.maps.maze import Cell, cell_to_point
from mazebench.tasks.context import START
from mazebench.world.lidar import LidarModel

from .beams import beams_of
from .body import LOOK_LEFT, LOOK_RIGHT, TURN_STEP, Body, Point, observed_body
from .cells import marked_cell, nearest_cell
from .contacts import felt_walls
from .driving import Drive
from .map_matching import MapBelief
from .map_reading import MapReading, read_map
from .occupancy import Occupancy
from .odometry import DeadReckoning
from .pilot import steer
from .planning import plan
from .tracking import Tracker, aligned

_BLOCKED = 0.35  # probability of a wall from which driving keeps clear of a cell off the path
_MARK_OFF = 1.0  # cells, standard deviation of the goal from its mark, once it was not there
# Cells, which are taken for 1 m wide: standard deviations of a position.
_EXACT, _TRACKED, _RECKONED = 0.01, 0.03, 0.15  # that is observed, tracked by a lidar, or reckoned from noisy ones
_GAIN = 0.03  # weight of a noisy position against the one that velocities tell
_ROUNDING = 1e-4  # of positions as float32


@dataclasses.dataclass
class Memory:
    """What the robot knows in one environment.

    All is on one grid of L x L cells: the maze where the pose is known, else one around the start.
    """

    occupancy: Occupancy
    belief: MapBelief  # of how the map lies on the occupancy grid
    prior: np.ndarray  # [L, L] float, the probability of a wall by the map
    goal: np.ndarray  # [L, L] float, the probability of the goal by the map
    body: Body  # on the grid
    deviation: float  # standard deviation of the body's position
    tracker: Tracker | None  # None where scans are not needed to know the pose, or there are none
    dead_reckoning: DeadReckoning | None  # where observed positions are noisy
    searched: np.ndarray  # [L, L] bool, the cells that the body was in, so that the goal is elsewhere
    drive: Drive = dataclasses.field(default_factory=Drive)  # the one that is under way
    commanded: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))  # the pose after the last action
    action: int = LOOK_LEFT  # the last one

    @property
    def cell(self) -> Cell:
        """The cell of the body."""
        return nearest_cell(self.body.x, self.body.y, len(self.searched))


class Robot:
    """What an agent of this family does in each step: `observe`, and `command` with what it believes."""

    def __init__(self, interface: Interface):
        """Acts in mazes of the interface, with its lidar if it has one."""
        self._size, self._cells_per_metre = interface.size, 1 / interface.cell_size
        self._noise = interface.odometry_noise
        self._has_lidar = "lidar" in interface.sensors
        self._beams = beams_of(interface.lidar or LidarModel(), self._cells_per_metre)

    def observe(self, memory: Memory | None, inputs: Inputs, slot: int) -> Memory:
        """Returns what is known after an observation in environment `slot`; a new memory where an episode begins."""
        observed = observed_body(inputs.observation["state"][slot].tolist(), self._cells_per_metre)
        context, ranges = inputs.observation["context"][slot], None
        if self._has_lidar:
            metres = inputs.observation["lidar"][slot].astype(np.float64)
            ranges = np.minimum(self._cells_per_metre * metres, self._beams.reach)
        if memory is None or inputs.new_episode[slot]:
            memory = self._begin(context, observed, ranges)
        else:
            if inputs.new_context[slot]:
                _begin_leg(memory, read_map(context, self._size))
            self._move(memory, observed, ranges)
        self._sense(memory, ranges)
        return memory

    def command(self, memory: Memory, walls: np.ndarray, goal: np.ndarray) -> int:
        """Returns the action that follows from what is believed.

        Args:
          memory: after `observe`; it remembers the command.
          walls: `[L, L]` float, the probability of a wall.
          goal: `[L, L]` float, the probability of the goal.
        """
        body = memory.body
        path = _path_to_goal(memory, walls, goal)
        action, point = LOOK_LEFT, body.rest()  # where there is no way, it waits
        if len(path) == 1:
            action = steer(body, tuple(cell_to_point(path[0], len(walls)).tolist()))
        elif path:
            blocked = walls > _BLOCKED
            blocked[tuple(np.transpose(path))] = False
            action, point = memory.drive.next(blocked, path, body, 1 / self._cells_per_metre)
        turn = TURN_STEP * ((action == LOOK_LEFT) - (action == LOOK_RIGHT))
        memory.commanded, memory.action = np.array([*point, body.yaw + turn]), action
        return action

    def _begin(self, context: np.ndarray, observed: Body, ranges: np.ndarray | None) -> Memory:
        """Returns what is known after an episode's first observation, before what was sensed is added."""
        known = _known_position(observed)
        reading = read_map(context, self._size, known)
        pose, odometry, middle, dead_reckoning = _pose(observed), _pose(observed), None, None
        if known is not None:
            # The grid is the maze. A start that is known but not marked says that the sheet may lie in any way.
            size, num_turns = self._size, 1 if context[START].any() else 8
        elif ranges is None:
            return self._begin_at_mark(reading, observed)
        else:
            # The grid has the start in its middle, and the axes of the maze or of the first scan.
            size, middle = 2 * self._size - 1, reading.start
            if odometry.any():
                pose[:2], num_turns = self._size - 0.5, 1
                dead_reckoning = DeadReckoning((observed.x, observed.y), observed.velocity())
            else:
                unseen = Occupancy.unseen(size).seen_walls()
                pose, num_turns = aligned(unseen, self._size - 0.5, self._size - 0.5, ranges, self._beams), 8
        is_tracked = ranges is not None and (known is None or self._noise > 0)
        x, y, yaw = pose.tolist()
        return _new_memory(
            MapBelief.begin(reading.walls, reading.goal, num_turns, middle, size),
            observed._replace(x=x, y=y, yaw=yaw),
            _TRACKED if is_tracked else _EXACT,
            Tracker(pose, odometry, self._noise) if is_tracked else None,
            dead_reckoning,
        )

    def _begin_at_mark(self, reading: MapReading, observed: Body) -> Memory:
        """Returns what is known without a lidar where the position is noisy: the start is where it is marked."""
        x, y = cell_to_point(marked_cell(reading.start), self._size).tolist()
        gain = _GAIN if _pose(observed).any() else 0.0  # odometry counts from another origin
        belief = MapBelief.begin(reading.walls, reading.goal, 1, None, self._size)
        dead_reckoning = DeadReckoning((x, y), observed.velocity(), gain)
        return _new_memory(belief, observed._replace(x=x, y=y), _RECKONED, None, dead_reckoning)

    def _move(self, memory: Memory, observed: Body, ranges: np.ndarray | None) -> None:
        """Takes in the body as it is observed one step on; without a lidar, what has stopped it is a wall."""
        before, body = memory.body, observed
        if memory.dead_reckoning is not None:
            body = memory.dead_reckoning.update(observed)
        if memory.tracker is not None and ranges is not None:
            walls = memory.occupancy.seen_walls()
            memory.tracker.update(walls, _pose(body), memory.commanded, ranges, self._beams)
            body = memory.tracker.body(observed)
        memory.body = body
        if ranges is None:
            size, cell_size = len(memory.searched), 1 / self._cells_per_metre
            off = memory.deviation * cell_size
            for cell, log_odds in felt_walls(before, memory.action, body, cell_size, off, size):
                memory.occupancy.feel(cell, log_odds)

    def _sense(self, memory: Memory, ranges: np.ndarray | None) -> None:
        """Takes in that the body is where it is, and a scan `[R]` if there is one."""
        body, deviation = memory.body, memory.deviation
        if ranges is not None:
            memory.occupancy.see((body.x, body.y, body.yaw), ranges, self._beams, deviation)
        # The episode would have ended in the goal. Near a cell's border, the body may be in another one.
        off_x, off_y = (abs(coordinate % 1.0 - 0.5) for coordinate in (body.x, body.y))
        if max(off_x, off_y) < 0.5 - 2 * deviation:
            memory.searched[memory.cell] = True
            if ranges is None:
                memory.occupancy.visit(memory.cell)
        if memory.belief.update(memory.occupancy.evidence, memory.searched):
            memory.prior, memory.goal = memory.belief.mixture()


def believed_by_rule(memory: Memory) -> tuple[np.ndarray, np.ndarray]:
    """Returns the probabilities of a wall and of the goal `[L, L]`: the map counts as much as it has proved right."""
    walls = memory.occupancy.walls(memory.prior)
    is_possible = ~(memory.searched | (memory.occupancy.is_seen() & (walls > 0.5)))
    goal = memory.goal * is_possible
    if not goal.any():
        goal = ndimage.gaussian_filter(memory.goal, _MARK_OFF, mode="constant") * is_possible
    return walls, goal


def _new_memory(
    belief: MapBelief, body: Body, deviation: float, tracker: Tracker | None, dead_reckoning: DeadReckoning | None
) -> Memory:
    """Returns the memory of an episode's first moment; the arguments are those of `Memory`."""
    prior, goal = belief.mixture()
    occupancy, searched = Occupancy.unseen(len(prior)), np.zeros(prior.shape, dtype=bool)
    return Memory(occupancy, belief, prior, goal, body, deviation, tracker, dead_reckoning, searched)


def _begin_leg(memory: Memory, reading: MapReading) -> None:
    """Takes in the map and the goal of another leg."""
    memory.belief = memory.belief.on_leg(reading.walls, reading.goal)
    memory.prior, memory.goal = memory.belief.mixture()
    memory.searched[:] = False


def _pose(body: Body) -> np.ndarray:
    """Returns x, y and yaw as `[3]` float."""
    return np.array([body.x, body.y, body.yaw])


def _known_position(observed: Body) -> Point | None:
    """Returns where on the map an episode begins, if the first state tells it: then it is the centre of a cell."""
    off_centre = max(abs(coordinate % 1.0 - 0.5) for coordinate in (observed.x, observed.y))
    return (observed.x, observed.y) if off_centre < _ROUNDING else None


def _path_to_goal(memory: Memory, walls: np.ndarray, goal: np.ndarray) -> list[Cell]:
    """Returns the cells of a path to the goal; none if there is no cell left where it may be."""
    if not goal.any():
        return []
    closed = memory.occupancy.is_seen() & (walls > 0.5)
    return plan(np.where(closed, 1.0, walls), goal, memory.cell)
