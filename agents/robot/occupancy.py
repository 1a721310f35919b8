"""A log-odds occupancy grid of walls seen by lidar or felt, with a map as its prior.

Moravec & Elfes 1985; Thrun, Burgard & Fox 2005, Probabilistic Robotics, chapter 9. `beams` says what a scan tells.
Lengths are in cells. `L` is the number of cells on a side.
"""

from __future__ import annotations

import math

import numpy as np

from mazebench.kernels import compiled

from .beams import UNKNOWN

SURE = 3.0  # log odds of evidence, from which a cell counts as seen
_BINS = np.array([0.02, 0.1, 0.3, 0.5, 0.7, 0.9, 0.98])  # of prior probabilities, within which the map errs alike
_PRIOR_AREA = 3.0  # m^2 of seen cells that weigh as much as the prior when the map's reliability is estimated
_LEAST = 1e-6  # count of cells of a kind, instead of none


def seen_walls(evidence: np.ndarray) -> np.ndarray:
    """Returns `[L, L]` float: the probability of a wall by evidence `[L, L]` (log odds) alone."""
    return 1 / (1 + np.exp(-evidence) * ((1 - UNKNOWN) / UNKNOWN))


@compiled
def posterior(prior: np.ndarray, evidence: np.ndarray, cell_size: float = 1.0) -> np.ndarray:
    """Returns `[L, L]` float: the probability of a wall, by evidence and a prior as reliable as it has proved to be.

    Where a cell was seen, evidence alone counts: what was seen is no longer tried, however right the map has been.

    Among cells of similar prior probability, the share of walls is estimated from those that were seen: the mean of a
    beta distribution. Its prior counts weigh as much as 3 m^2 of seen cells.

    Args:
      prior: `[L, L]` float; 1 for walls that are certain.
      evidence: `[L, L]` float, log odds.
      cell_size: m.
    """
    prior_cells = _PRIOR_AREA / cell_size**2
    bin_of = np.searchsorted(_BINS, prior.ravel(), side="right").reshape(prior.shape)
    num_seen, num_walls = np.zeros(len(_BINS) + 1), np.zeros(len(_BINS) + 1)
    for row in range(len(prior)):
        for column in range(len(prior)):
            if abs(evidence[row, column]) >= SURE and prior[row, column] < 1:
                num_seen[bin_of[row, column]] += 1
                num_walls[bin_of[row, column]] += evidence[row, column] > 0
    probability = np.ones(prior.shape)
    for row in range(len(prior)):
        for column in range(len(prior)):
            if prior[row, column] < 1:
                similar = bin_of[row, column]
                wall = prior_cells * prior[row, column] + num_walls[similar]
                free = prior_cells * (1 - prior[row, column]) + num_seen[similar] - num_walls[similar]
                odds_free = math.exp(-evidence[row, column])
                if abs(evidence[row, column]) < SURE:
                    odds_free *= max(free, _LEAST) / max(wall, _LEAST)
                probability[row, column] = 1 / (1 + odds_free)
    return probability
