"""Where the walls are: a log-odds occupancy grid of the map as prior and what lidar saw.

Moravec & Elfes 1985; Thrun, Burgard & Fox 2005, Probabilistic Robotics, chapter 9. Cells along a ray are free and the
cell at its end is a wall. The sensor is exact and walls are whole cells, so one ray settles a cell unless the pose is
uncertain. Lengths are in cells, which the constants take for 1 m wide. `N` is the number of cells on a side.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from mazebench.world.lidar import MAX_RANGE

from ..common.kernels import compiled, inlined
from ..robot import rays

_RAY = 6.0  # log odds that one ray adds to a cell where the pose is sure
_LARGEST = 12.0  # log odds: two rays' worth, so that errors can be undone
_SURE = 3.0  # log odds of evidence, from which a cell counts as seen
_EXACT = 0.02  # ends of rays this near to a corner or grazing a cell by less are not used
_GRAZING = 0.1  # sine of the angle between a ray and a wall, below which its end is not used
_BINS = np.array([0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.98])  # of prior probabilities, within which the map errs alike
_PRIOR_CELLS = 3.0  # seen cells that weigh as much as the prior when the map's reliability is estimated
_LEAST = 1e-6  # count of cells of a kind, instead of none


@dataclasses.dataclass
class Occupancy:
    """The estimate of one maze's walls."""

    prior: np.ndarray  # [N, N] float, the probability of a wall by the map
    evidence: np.ndarray  # [N, N] float, log odds of a wall that lidar adds to the prior
    reach: float  # of the sensor; a ray as long saw no wall

    @classmethod
    def of_map(cls, prior: np.ndarray, reach: float = MAX_RANGE) -> Occupancy:
        """Returns the estimate before anything was seen."""
        return cls(prior, np.zeros_like(prior), reach)

    def see(self, x: float, y: float, yaw: float, ranges: np.ndarray, uncertainty: float = 0.0) -> None:
        """Takes in the ranges `[32]` seen from a pose, whose position has the standard deviation `uncertainty`."""
        margin = _EXACT + 2 * uncertainty
        log_odds = _RAY / (1 + (uncertainty / _EXACT) ** 2)
        _trace_rays(self.evidence, x, y, yaw, ranges, self.reach, margin, log_odds)

    def probability(self) -> np.ndarray:
        """Returns `[N, N]` float: the probability of a wall in each cell."""
        return posterior(self.prior, self.evidence, _BINS, _PRIOR_CELLS)

    def is_seen(self) -> np.ndarray:
        """Returns `[N, N]` bool: the cells of which lidar tells what they are."""
        return np.abs(self.evidence) >= _SURE


@compiled
def posterior(prior: np.ndarray, evidence: np.ndarray, bins: np.ndarray, prior_cells: float) -> np.ndarray:
    """Returns `[N, N]` float: the probability of a wall, by a prior as reliable as it has proved to be, and evidence.

    Among cells of similar prior probability, the share of walls is estimated from those that were seen: the mean of a
    beta distribution. Its prior counts weigh as much as `prior_cells` seen cells.

    Args:
      prior: `[N, N]` float; 1 for walls that are certain.
      evidence: `[N, N]` float, log odds.
      bins: the probabilities between which priors are similar, ascending.
      prior_cells: see above.
    """
    bin_of = np.searchsorted(bins, prior.ravel(), side="right").reshape(prior.shape)
    num_seen, num_walls = np.zeros(len(bins) + 1), np.zeros(len(bins) + 1)
    for row in range(len(prior)):
        for column in range(len(prior)):
            if abs(evidence[row, column]) >= _SURE and prior[row, column] < 1:
                num_seen[bin_of[row, column]] += 1
                num_walls[bin_of[row, column]] += evidence[row, column] > 0
    probability = np.ones(prior.shape)
    for row in range(len(prior)):
        for column in range(len(prior)):
            if prior[row, column] < 1:
                similar = bin_of[row, column]
                wall = prior_cells * prior[row, column] + num_walls[similar]
                free = prior_cells * (1 - prior[row, column]) + num_seen[similar] - num_walls[similar]
                odds_free = max(free, _LEAST) / max(wall, _LEAST) * math.exp(-evidence[row, column])
                probability[row, column] = 1 / (1 + odds_free)
    return probability


@compiled
def _trace_rays(
    evidence: np.ndarray,
    x: float,
    y: float,
    yaw: float,
    ranges: np.ndarray,
    reach: float,
    margin: float,
    log_odds: float,
) -> None:
    """Adds what the rays of a scan tell to `evidence` `[N, N]`.

    `margin` is how far a ray's end may be off. What could as well belong to another cell is not used.
    """
    for i in range(len(ranges)):
        angle = yaw + 2 * math.pi * i / len(ranges)
        dx, dy, length = math.cos(angle), math.sin(angle), float(ranges[i])
        _clear(evidence, x, y, dx, dy, length, margin, log_odds)
        if length < reach:
            _mark(evidence, x + length * dx, y + length * dy, dx, dy, margin, log_odds)


@compiled
def _clear(
    evidence: np.ndarray, x: float, y: float, dx: float, dy: float, length: float, margin: float, log_odds: float
) -> None:
    """Adds that the cells along a ray of some length are free.

    A cell is free if the middle of the part of the ray in it is at least `margin` away from the cell's edges.
    """
    ray, entered = rays.ray_from(x, y, dx, dy), 0.0
    while entered < length and rays.is_on(ray, evidence):
        left = min(rays.leaves_at(ray), length)
        middle = (entered + left) / 2
        depth_x, depth_y = x + middle * dx - ray.column, y + middle * dy - ray.level
        if min(depth_x, 1 - depth_x, depth_y, 1 - depth_y) >= margin:
            _add(evidence, ray.level, ray.column, -log_odds)
        ray, entered = rays.in_next_cell(ray), left


@compiled
def _mark(
    evidence: np.ndarray, end_x: float, end_y: float, dx: float, dy: float, margin: float, log_odds: float
) -> None:
    """Adds that a ray with direction (dx, dy) ends at a wall at (end_x, end_y).

    Walls begin at lines of the grid, so the end must be nearer than `margin` to one of them; near a corner, where two
    of them meet, the wall could be one of several cells.
    """
    line_x, line_y = round(end_x), round(end_y)
    at_x, at_y = abs(end_x - line_x) < margin, abs(end_y - line_y) < margin
    if at_x == at_y or abs(dx if at_x else dy) < _GRAZING:
        return
    column = int(line_x) - (dx < 0) if at_x else math.floor(end_x)
    level = math.floor(end_y) if at_x else int(line_y) - (dy < 0)
    size = len(evidence)
    if 0 <= column < size and 0 <= level < size:
        _add(evidence, level, column, log_odds)


@inlined
def _add(evidence: np.ndarray, level: int, column: int, log_odds: float) -> None:
    """Adds log odds to a cell; `level` is its row counted from below."""
    row = len(evidence) - 1 - level
    evidence[row, column] = min(max(evidence[row, column] + log_odds, -_LARGEST), _LARGEST)
