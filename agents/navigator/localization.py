"""Where the body is on a map: a bank of weighted poses, from odometry and lidar.

The walls lie on the grid of the cells. So one scan tells the pose without a map, but for the grid's own symmetries:
the heading up to quarter turns, and the position within a cell. Odometry that is corrected by that at each step does
not drift. What is left to find is discrete, the cell and the quarter turn. Each combination is a hypothesis: a pose
that moves along with the odometry, weighted by how well the map explains the scans from there. This is multiple
hypothesis localization (Jensfelt & Kristensen 2001) with a grid filter's weights (Thrun, Burgard & Fox 2005,
Probabilistic Robotics, section 8.2). Nothing in it is random.

Lengths are in cells, which the constants take for 1 m wide. `H` is the number of hypotheses, `N` the number of cells
on a side of the map.
"""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple

import numpy as np

from mazebench.maps.maze import Cell, cell_to_point
from mazebench.world.angles import wrap_angle
from mazebench.world.lidar import MAX_RANGE

from . import scans
from .scans import WallFrame

# A weight is raised to this power before each scan: scans from nearby share the map's errors, so they are not as much
# evidence as independent ones.
_MEMORY = 0.95

# Differences of log weights.
_NEGLIGIBLE = 40.0  # from the likeliest hypothesis to one that is dropped
_CLEARLY = 0.5  # from the first hypothesis to one that takes its place; smaller differences are rounding errors
_AT_GOAL = 10.0  # that a hypothesis in the goal cell, where the episode would have ended, loses by each scan

_INSIDE = 0.48  # to either side of a cell's centre; nearer to the border, rounding may decide

# The odometry's scale is uniform in .9 to 1.1, and corrected steps are 0.01 off. The ratio of these variances is what a
# scale of 1 weighs against squared steps.
_SCALE_PRIOR = 0.01**2 / (0.2**2 / 12)

# If the likeliest pose explains less than this share of the rays, so many scans in a row, all poses are considered.
_POOR = 0.5
_NUM_POOR = 5


class Belief(NamedTuple):
    """What is known of the body's pose: hypotheses, of which the first one is the likeliest."""

    poses: np.ndarray  # [H, 3] float, H >= 1: x, y and yaw (rad) on the map
    weights: np.ndarray  # [H] float, the probabilities of the poses
    explained: float  # the share of the last scan's rays that the map explains from the first pose
    odometry: np.ndarray  # [3] float, the last reading
    driven: float  # the sum of the odometry's squared steps and of the prior
    moved: float  # the sum of these steps' products with the corrected ones and of the prior
    num_poor: int  # the number of scans in a row, up to the last one, of which too little is explained
    reach: float = MAX_RANGE  # of the sensor; a ray as long saw no wall

    @property
    def pose(self) -> np.ndarray:
        """The likeliest pose `[3]`. It stays that of one hypothesis until another one is clearly likelier."""
        return self.poses[0]

    @property
    def confidence(self) -> float:
        """The probability of the likeliest pose."""
        return float(self.weights[0])


def begin(
    walls: np.ndarray,
    start_distribution: np.ndarray,
    odometry: np.ndarray,
    ranges: np.ndarray,
    goal: Cell | None = None,
    heading: float | None = None,
    reach: float = MAX_RANGE,
) -> Belief:
    """Returns the belief after the first scan of an episode.

    Args:
      walls: `[N, N]` bool, the map.
      start_distribution: `[N, N]` float, the probability that the body is in a cell.
      odometry: `[3]`, x, y and yaw (rad) in the odometry's own frame.
      ranges: `[32]`, the scan.
      goal: the cell in which the body is not, because the episode would have ended there.
      heading: rad, on the map; None if it is unknown.
      reach: of the sensor; a ray as long saw no wall.
    """
    ranges = np.asarray(ranges, dtype=np.float64)
    poses, weights = _poses_within(start_distribution, scans.wall_frame(ranges, reach))
    if heading is not None:
        off = np.abs(wrap_angle(poses[:, 2] - heading))
        poses, weights = poses[off == off.min()], weights[off == off.min()]
    reading = np.array(odometry, dtype=np.float64)
    belief = Belief(poses, weights, 1.0, reading, driven=_SCALE_PRIOR, moved=_SCALE_PRIOR, num_poor=0, reach=reach)
    return _weighted(belief, walls, ranges, goal)


def update(
    belief: Belief, walls: np.ndarray, odometry: np.ndarray, ranges: np.ndarray, goal: Cell | None = None
) -> Belief:
    """Returns the belief one step on; the arguments are those of `begin`."""
    ranges = np.asarray(ranges, dtype=np.float64)
    frame = scans.wall_frame(ranges, belief.reach)
    belief = _moved(belief, np.array(odometry, dtype=np.float64), frame)
    belief = _weighted(belief, walls, ranges, goal)
    if belief.num_poor < _NUM_POOR or np.isnan(frame).any():
        return belief
    return _weighted(_reconsidered(belief, walls, frame), walls, ranges, goal)


def _poses_within(distribution: np.ndarray, frame: WallFrame) -> tuple[np.ndarray, np.ndarray]:
    """Returns the poses `[H, 3]` in the cells of a distribution that agree with a scan's wall frame, and weights `[H]`.

    Where the frame tells no position, it is the middle of the cell, where an episode begins.
    """
    heading, x, y = np.where(np.isnan(frame), (0.0, 0.5, 0.5), frame).tolist()
    turned = np.array([_turned((heading, x, y), turns) for turns in range(4)])  # [4, 3] yaw, x, y
    cells = np.argwhere(distribution > 0)
    poses = np.empty((len(cells), 4, 3))
    poses[..., :2] = (cell_to_point(cells, len(distribution)) - 0.5)[:, None] + turned[:, 1:]
    poses[..., 2] = turned[:, 0]
    weights = np.repeat(distribution[tuple(cells.T)], 4)
    return poses.reshape(-1, 3), weights / weights.sum()


def _moved(belief: Belief, odometry: np.ndarray, frame: WallFrame) -> Belief:
    """Returns the belief with all poses moved by the odometry's step, which a scan's wall frame corrects."""
    # The odometry's step, forward + left j in the body's frame.
    step_x, step_y, turn = (odometry - belief.odometry).tolist()
    measured = complex(step_x, step_y) * cmath.rect(1, -belief.odometry[2])

    # All poses agree with the wall frame, so the first one's correction is everyone's.
    x, y, yaw = belief.poses[0].tolist()
    predicted = measured * cmath.rect(belief.moved / belief.driven, yaw)
    new_x, new_y, new_yaw = _aligned(x + predicted.real, y + predicted.imag, yaw + turn, frame)
    corrected = complex(new_x - x, new_y - y) * cmath.rect(1, -yaw)

    steps = corrected * np.exp(1j * belief.poses[:, 2])
    yaws = wrap_angle(belief.poses[:, 2] + new_yaw - yaw)
    return belief._replace(
        poses=np.stack([belief.poses[:, 0] + steps.real, belief.poses[:, 1] + steps.imag, yaws], axis=1),
        odometry=odometry,
        driven=belief.driven + abs(measured) ** 2,
        moved=belief.moved + (measured.conjugate() * corrected).real,
    )


def _aligned(x: float, y: float, yaw: float, frame: WallFrame) -> tuple[float, float, float]:
    """Returns the pose nearest to (x, y, yaw) that agrees with a scan's wall frame."""
    if math.isnan(frame[0]):
        return x, y, yaw
    new_yaw, within_x, within_y = _turned(frame, round((yaw - frame[0]) / (math.pi / 2)))
    return _nearest(x, within_x), _nearest(y, within_y), new_yaw


def _nearest(coordinate: float, within: float) -> float:
    return coordinate if math.isnan(within) else within + round(coordinate - within)


def _turned(frame: WallFrame, turns: int) -> WallFrame:
    """Returns the wall frame that the scan would have, had the grid's axes been named `-turns` quarter turns on."""
    heading, x, y = frame
    for _ in range(turns % 4):
        x, y = 1 - y, x
    return heading + turns * math.pi / 2, x, y


def _weighted(belief: Belief, walls: np.ndarray, ranges: np.ndarray, goal: Cell | None) -> Belief:
    """Returns the belief with weights after a scan, the likeliest pose first, without negligible ones."""
    # What the scan says of each pose, and that no episode goes on in the goal.
    log_likelihoods, explained = scans.score(walls, belief.poses, ranges, belief.reach)
    log_weights = _MEMORY * np.log(belief.weights) + log_likelihoods
    if goal is not None:
        from_goal = np.abs(belief.poses[:, :2] - cell_to_point(goal, len(walls))).max(axis=1)
        log_weights[from_goal < _INSIDE] -= _AT_GOAL
    log_weights -= log_weights.max()

    # The first pose stays the first one unless another one is clearly likelier.
    rank = log_weights.copy()
    rank[0] += _CLEARLY
    order = np.argsort(-rank, kind="stable")
    order = order[log_weights[order] > -_NEGLIGIBLE]

    weights = np.exp(log_weights[order])
    return belief._replace(
        poses=belief.poses[order],
        weights=weights / weights.sum(),
        explained=float(explained[order[0]]),
        num_poor=belief.num_poor + 1 if explained[order[0]] < _POOR else 0,
    )


def _reconsidered(belief: Belief, walls: np.ndarray, frame: WallFrame) -> Belief:
    """Returns a belief in which the likeliest pose has half of the probability, and all others on the map the rest."""
    others, _ = _poses_within((~walls).astype(np.float64), frame)

    # Among them is the likeliest pose itself, up to what the scan's frame corrects.
    apart = np.abs(others - belief.pose)
    elsewhere, turned = apart[:, :2].max(axis=1) > 0.5, np.abs(wrap_angle(apart[:, 2])) > math.pi / 4
    others = others[elsewhere | turned]

    # `_weighted` normalizes, so that nothing is lost where there are no others: on a map without another free cell.
    weights = np.full(1 + len(others), 0.5)
    weights[1:] /= max(len(others), 1)
    return belief._replace(poses=np.concatenate([belief.poses[:1], others]), weights=weights, num_poor=0)
