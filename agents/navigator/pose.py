"""Where the body is on the map: as the state tells it, or by localization where the state does not."""

from __future__ import annotations

import dataclasses

import numpy as np

from mazebench.maps.maze import Cell
from mazebench.world.lidar import MAX_RANGE

from ..robot.body import Body, Point
from ..robot.odometry import DeadReckoning
from . import localization
from .localization import Belief
from .map_reading import MapReading

_CONFIDENT = 0.9  # probability of a pose from which it is taken for the true one
# Cells, which are taken for 1 m wide.
_DEVIATION = 0.02  # standard deviation of a position that is found by localization
_ROUNDING = 1e-4  # of positions as float32
_JUMP = 1.0  # a body does not move so far in a step, so another hypothesis became the likeliest


@dataclasses.dataclass
class PoseEstimate:
    """The estimated pose of one environment's body."""

    body: Body  # with the likeliest pose on the map
    belief: Belief | None = None  # None where the state tells the pose
    dead_reckoning: DeadReckoning | None = None  # the odometry; None where it is the pose of the state

    @classmethod
    def begin(cls, reading: MapReading, observed: Body, ranges: np.ndarray, reach: float = MAX_RANGE) -> PoseEstimate:
        """Returns the estimate after the first observation of an episode; `reach` is the range sensor's, in cells."""
        if known_position(observed) is not None:
            return cls(observed)
        heading, dead_reckoning = None, None
        # The origin lies in the border of any maze: there, the pose counts from the start, and tells no place on the
        # map. Elsewhere, noise moved the position off a cell's centre. Then adding up the velocities tells the way.
        if (observed.x, observed.y, observed.yaw) != (0.0, 0.0, 0.0):
            heading = observed.yaw
            dead_reckoning = DeadReckoning((observed.x, observed.y), observed.velocity())
        goal = _only_cell(reading.goal)
        walls = reading.walls > 0.5
        belief = localization.begin(walls, reading.start, _pose(observed), ranges, goal, heading, reach)
        return cls(_placed(observed, belief), belief, dead_reckoning)

    @property
    def is_certain(self) -> bool:
        """Whether the pose is taken for the true one."""
        return self.belief is None or self.belief.confidence >= _CONFIDENT

    @property
    def deviation(self) -> float:
        """The standard deviation of the position in cells, if the pose is certain."""
        return 0.0 if self.belief is None else _DEVIATION

    def update(self, reading: MapReading, seen_walls: np.ndarray, observed: Body, ranges: np.ndarray) -> bool:
        """Takes in an observation; returns whether an unlike pose became the likeliest.

        Args:
          reading: of the map.
          seen_walls: `[N, N]` bool, the walls by the map and what was seen.
          observed: the body as the state has it.
          ranges: `[32]` cells, the scan.
        """
        if self.belief is None:
            self.body = observed
            return False
        # What was seen explains scans from a wrong pose as well as from the true one. So it is used only where the
        # start is known.
        walls, odometry = reading.walls > 0.5, observed
        if self.dead_reckoning is not None:
            walls, odometry = seen_walls, self.dead_reckoning.update(observed)
        before = self.belief.pose
        self.belief = localization.update(self.belief, walls, _pose(odometry), ranges, _only_cell(reading.goal))
        self.body = _placed(observed, self.belief)
        return bool(np.abs(self.belief.pose - before)[:2].max() > _JUMP)


def known_position(observed: Body) -> Point | None:
    """Returns where on the map an episode begins, if the first state tells it: then it is the centre of a cell."""
    off_centre = max(abs(coordinate % 1.0 - 0.5) for coordinate in (observed.x, observed.y))
    return (observed.x, observed.y) if off_centre < _ROUNDING else None


def _pose(body: Body) -> np.ndarray:
    """Returns x, y and yaw as `[3]` float."""
    return np.array([body.x, body.y, body.yaw])


def _placed(observed: Body, belief: Belief) -> Body:
    x, y, yaw = belief.pose.tolist()
    return observed._replace(x=x, y=y, yaw=yaw)


def _only_cell(goal: np.ndarray) -> Cell | None:
    """Returns the one cell that a distribution `[N, N]` leaves, None if it leaves several."""
    cells = np.argwhere(goal > 0)
    return (int(cells[0, 0]), int(cells[0, 1])) if len(cells) == 1 else None
