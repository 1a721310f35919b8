"""The senses of a robot: it localizes itself, maps the walls that it senses, and finds out how the shown map lies.

It senses walls by its lidar, by its camera and touch, or by touch alone. It measures lengths in cells. `L` is the
number of cells on a side of its grid: the maze where the position is known, else a grid around the start.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from typing import ClassVar

import numpy as np
from scipy import ndimage

from mazebench.agent import Inputs, Interface, Report
from mazebench.errors import UnplayableError
from mazebench.maps.maze import Cell, cell_to_point
from mazebench.tasks.context import START
from mazebench.world.ray_casting import LidarModel

from .beams import MOST_EVIDENCE, add_scan, beams_of
from .cells import marked_cell, nearest_cell
from .contacts import felt_walls
from .dead_reckoning import DeadReckoning
from .map_matching import MapBelief
from .map_reading import guess_by, map_reader, read_map
from .moving_body import LOOK_LEFT, LOOK_RIGHT, MovingBody, Point, observed_body
from .occupancy import SURE, posterior, seen_walls
from .tracking import Tracker, aligned

_MARK_OFF = 1.0  # m, standard deviation of the goal from its marker, once it was not there
# Standard deviations (m) of a position.
_EXACT, _TRACKED, _RECKONED = 0.01, 0.03, 0.15  # that is observed, tracked by a lidar, or reckoned from noisy ones
_VISITED = 4.0  # log odds that a cell is free in which the body was
_GAIN = 0.03  # weight of a noisy position against the one that velocities tell
_ALL_ROUND = 270.0  # degrees of a view, from which turning shows nothing new
_ROUNDING = 1e-4  # of positions as float32


@dataclasses.dataclass
class Memory:
    """Everything that the robot knows in one environment; all is on one grid."""

    belief: MapBelief  # of how the map lies on the grid
    body: MovingBody
    deviation: float  # standard deviation of the body's position, m
    cell_size: float  # m
    tracker: Tracker | None = None  # where a lidar is needed to know the pose
    dead_reckoning: DeadReckoning | None = None  # where observed positions are noisy
    evidence: np.ndarray = dataclasses.field(init=False)  # [L, L] float, log odds of a wall by what was seen or felt
    prior: np.ndarray = dataclasses.field(init=False)  # [L, L] float, the probability of a wall by the map
    goal: np.ndarray = dataclasses.field(init=False)  # [L, L] float, the probability of the goal by the map
    searched: np.ndarray = dataclasses.field(init=False)  # [L, L] bool, cells without the goal: the body was in them
    commanded: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))  # the pose after the last action
    action: int = LOOK_LEFT  # the last one
    heading: float | None = None  # rad, with which the last action drives; None for the body's

    def __post_init__(self) -> None:
        self.prior, self.goal = self.belief.mixture()
        self.evidence = np.zeros(self.prior.shape)
        self.searched = np.zeros(self.prior.shape, dtype=bool)

    @property
    def cell(self) -> Cell:
        """The cell of the body."""
        return nearest_cell(self.body.x, self.body.y, len(self.searched))

    @property
    def pose_on_map(self) -> tuple[float, float, float]:
        """The body's x, y (m) and yaw (rad) on the map as it is shown, by the likeliest way in which it may lie."""
        x, y, yaw = self.belief.on_map(self.body.x, self.body.y, self.body.yaw)
        return x * self.cell_size, y * self.cell_size, yaw

    def estimate(self, prior: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Returns `[L, L]` float twice: the probability of a wall, and weights of the goal, perhaps all 0.

        The map counts as much as it has proved right, but a given `prior`, `[L, L]` float, counts as it is. The goal is
        in no cell that was searched, nor in a seen wall.
        """
        if prior is None:
            walls = posterior(self.prior, self.evidence, self.cell_size)
        else:
            odds_free = np.where(np.abs(self.evidence) < SURE, (1 - prior) / prior, 1.0)
            walls = np.where(prior < 1, 1 / (1 + odds_free * np.exp(-self.evidence)), 1.0)
        is_closed = (np.abs(self.evidence) >= SURE) & (walls > 0.5)
        is_possible = ~(self.searched | is_closed)
        goal = self.goal * is_possible
        if not goal.any():
            goal = ndimage.gaussian_filter(self.goal, _MARK_OFF / self.cell_size, mode="constant") * is_possible
        return np.where(is_closed, 1.0, walls), goal

    def command(self, action: int, point: Point, heading: float | None = None, turn: float | None = None) -> None:
        """Remembers the action that follows, and the point (x, y) that it should bring the body to.

        With a `heading` of its own, it drives as a body with this heading would, and turns by `turn` looks to the left.
        """
        looks = (action == LOOK_LEFT) - (action == LOOK_RIGHT) if turn is None else turn
        self.commanded, self.action = np.array([*point, self.body.yaw + self.body.model.turn_step * looks]), action
        self.heading = heading


def report(memories: Iterable[Memory | None]) -> Report:
    """Returns the poses of robots on the maps that they are shown; that of one that has not begun is unknown."""
    return Report(np.array([(np.nan,) * 3 if each is None else each.pose_on_map for each in memories]))


def range_sensor(sensors: tuple[str, ...]) -> tuple[str, ...]:
    """Returns the one of some sensors from which a robot has ranges: the lidar, or the camera's pictures; or none."""
    return tuple(name for name in ("lidar", "egocentric") if name in sensors)[:1]


class Senses:
    """The senses of a robot in the environments of one interface, with their lidar or camera if they have one."""

    num_turns: ClassVar[int] = 8  # ways in which a map may lie that does not mark the start

    def __init__(self, interface: Interface, agent: str):
        """Raises `UnplayableError`, in the name of `agent`, if maps have less than a pixel per cell.

        It raises it also if there are sensors, but no lidar and no camera that it can read ranges from.
        """
        if interface.context_size < interface.size:
            raise UnplayableError(f"agent {agent!r}: expected maps of at least a pixel per cell, found fewer")
        self._size, self._cell_size = interface.size, interface.cell_size
        self._body, self._odometry_noise = interface.body, interface.odometry_noise
        reader = map_reader(interface)
        self._guess = None if reader is None else guess_by(reader)
        lidar = interface.lidar or LidarModel()
        self._beams, self._camera = beams_of(lidar, 1 / self._cell_size, self._body.lidar_offset), None
        ranging = range_sensor(interface.sensors)
        self._has_ranges = ranging == ("lidar",)
        self.feels, self.is_narrow = not self._has_ranges, False  # whether it also feels walls, and sees ahead only
        if interface.camera is not None and ranging == ("egocentric",):
            from .camera_ranges import CameraRanges  # which needs PyTorch

            self._camera, self._has_ranges = CameraRanges(interface.camera, agent), True
            self._beams = self._camera.beams(1 / self._cell_size)
            self.is_narrow = interface.camera.fov < _ALL_ROUND
        elif interface.sensors:
            interface.require_sensor("lidar", agent)

    def look(self, inputs: Inputs) -> Inputs:
        """Returns inputs in which robots without a lidar have ranges from their pictures in its place."""
        if self._camera is None:
            return inputs
        ranges = self._camera.read(inputs.observation["egocentric"], inputs.active)
        return inputs._replace(observation=inputs.observation | {"lidar": ranges})

    def observe(self, memory: Memory | None, inputs: Inputs, slot: int) -> Memory:
        """Returns the memory after an observation in environment `slot`; a new one where an episode begins."""
        observed = observed_body(self._body, inputs.observation["state"][slot].tolist(), 1 / self._cell_size)
        context, ranges = inputs.observation["context"][slot], None
        if self._has_ranges:
            metres = inputs.observation["lidar"][slot].astype(np.float64)
            ranges = np.minimum(metres / self._cell_size, self._beams.reach)

        # The map, and where the body is on the grid.
        if memory is None or inputs.new_episode[slot]:
            memory = self._begin(context, observed, ranges)
        else:
            if inputs.new_context[slot]:
                # Another map and goal, on a map that lies as the one before.
                reading = read_map(context, self._size, self._guess)
                memory.belief.begin_leg(reading.walls, reading.goal)
                memory.prior, memory.goal = memory.belief.mixture()
                memory.searched[:] = False
            self._localize(memory, observed, ranges)

        # What the scan tells of walls.
        body, deviation = memory.body, memory.deviation / self._cell_size
        if ranges is not None:
            self.write(memory.evidence, body, ranges, deviation)

        # The episode would have ended in the goal. Near a cell's border, the body may be in another one.
        off_x, off_y = (abs(coordinate % 1.0 - 0.5) for coordinate in (body.x, body.y))
        if max(off_x, off_y) < 0.5 - 2 * deviation:
            memory.searched[memory.cell] = True
            if ranges is None:
                memory.evidence[memory.cell] = max(memory.evidence[memory.cell] - _VISITED, -MOST_EVIDENCE)

        # Where the map may lie, after all that.
        if memory.belief.update(memory.evidence, memory.searched):
            memory.prior, memory.goal = memory.belief.mixture()
        return memory

    def write(self, evidence: np.ndarray, body: MovingBody, ranges: np.ndarray, deviation: float) -> None:
        """Adds what a scan (cells) from a body tells to `evidence`, in place; `deviation` (cells) is the position's."""
        add_scan(evidence, body.x, body.y, body.yaw, ranges, self._beams, deviation)

    def _begin(self, context: np.ndarray, observed: MovingBody, ranges: np.ndarray | None) -> Memory:
        """Returns the memory at an episode's first observation, before the walls that are sensed are added."""
        # An episode begins in the centre of a cell. Zero is odometry; any other position is a noisy one.
        off_centre = max(abs(coordinate % 1.0 - 0.5) for coordinate in (observed.x, observed.y))
        reading, odometry = read_map(context, self._size, self._guess), _pose(observed)
        if off_centre < _ROUNDING:
            # The grid is the maze. A start that is known but not marked says that the map may lie in any way.
            num_turns = 1 if context[START].any() else self.num_turns
            belief = MapBelief(reading.walls, reading.goal, num_turns, None, self._size)
            if ranges is None or self._odometry_noise == 0:
                return Memory(belief, observed, _EXACT, self._cell_size)
            tracker = Tracker(odometry, odometry, self._odometry_noise)
            return Memory(belief, observed, _TRACKED, self._cell_size, tracker)
        if ranges is None:
            # The grid is the maze, and the start is where it is marked.
            x, y = cell_to_point(marked_cell(reading.start), self._size).tolist()
            belief = MapBelief(reading.walls, reading.goal, 1, None, self._size)
            dead_reckoning = DeadReckoning((x, y), observed.velocity(), _GAIN)
            return Memory(belief, observed._replace(x=x, y=y), _RECKONED, self._cell_size, None, dead_reckoning)

        # The grid has the start in its middle, and the axes of the maze or of the first scan.
        size, reckoning = 2 * self._size - 1, None
        if odometry.any():
            pose, num_turns = np.array([size / 2, size / 2, observed.yaw]), 1
            reckoning = DeadReckoning((observed.x, observed.y), observed.velocity())
        else:
            pose, num_turns = aligned(size, ranges, self._beams), 8
        belief = MapBelief(reading.walls, reading.goal, num_turns, reading.start, size)
        x, y, yaw = pose.tolist()
        tracker = Tracker(pose, odometry, self._odometry_noise)
        return Memory(belief, observed._replace(x=x, y=y, yaw=yaw), _TRACKED, self._cell_size, tracker, reckoning)

    def _localize(self, memory: Memory, observed: MovingBody, ranges: np.ndarray | None) -> None:
        """Takes in the body as it is observed one step on; without a lidar, a wall has stopped it if it is slow."""
        before, body = memory.body, observed
        if memory.dead_reckoning is not None:
            body = memory.dead_reckoning.update(observed)
        if memory.tracker is not None and ranges is not None:
            walls = seen_walls(memory.evidence)
            memory.tracker.update(walls, _pose(body), memory.commanded, ranges, self._beams)
            body = memory.tracker.body(observed)
        memory.body = body
        if self.feels:
            off, size = memory.deviation, len(memory.searched)
            if memory.heading is not None:
                before = before.turned(memory.heading)
            for cell, log_odds in felt_walls(before, memory.action, body, self._cell_size, off, size):
                memory.evidence[cell] = min(memory.evidence[cell] + log_odds, MOST_EVIDENCE)


def _pose(body: MovingBody) -> np.ndarray:
    """Returns x, y and yaw as `[3]` float."""
    return np.array([body.x, body.y, body.yaw])
