"""The learned belief: a small residual network that corrects the rule's estimate of walls and of the goal.

It sees no coordinates and no lattice, and it is convolutional, so it serves mazes of any size and of any kind. Before
anything is learned, its corrections are zero. `C` is the number of planes, `L` of cells on a side of the grid, `H` and
`W` of those in the box around what may be free, `B` of views in a batch.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import torch
from scipy import ndimage
from torch import nn
from torch.nn import functional

from ..robot.occupancy import SURE, Occupancy

_LARGEST = 8.0  # log odds and log weights, to which they are clipped
_SCALE = 4.0  # log odds that are 1 in a plane
_LEAST = 1e-5  # probability, so that logarithms are finite
# The goal where no mark tells: shares of the mark itself, of its surroundings near and far, and of all cells.
_MARK, _NEAR, _FAR, _ANYWHERE = 0.94, 0.04, 0.018, 0.002
_NEAR_CELLS, _FAR_CELLS = 1.0, 3.0  # standard deviations
_PRIOR_CELLS = 3.0  # seen cells that weigh as much as the guess that the map is right

NUM_PLANES = 11
WALL, GOAL = range(2)  # the network's outputs


class View(NamedTuple):
    """What a robot knows of the walls and the goal, without the learned belief."""

    prior: np.ndarray  # [L, L] float, the probability of a wall by the map; 1 where it is certain
    evidence: np.ndarray  # [L, L] float, log odds of a wall by what was seen or felt
    goal: np.ndarray  # [L, L] float, the probability of the goal by its mark; sums to 1
    searched: np.ndarray  # [L, L] bool, the cells that the goal is not in


class Picture(NamedTuple):
    """A view as the network reads it, in the box around what may be free."""

    box: tuple[slice, slice]  # of the grid; outside of it, walls are certain
    walls: np.ndarray  # [H, W] float, the probability of a wall by the rule
    planes: np.ndarray  # [C, H, W] float32
    rule: np.ndarray  # [2, H, W] float32: log odds of a wall, and log weights of the goal, by the rule
    unseen: np.ndarray  # [H, W] bool, cells whose walls are to be estimated
    possible: np.ndarray  # [H, W] bool, cells where the goal may be


def picture(view: View) -> Picture:
    """Returns a view as the network reads it."""
    open_cells = view.prior < 1
    box = _box(open_cells)
    prior, evidence, mark, searched, is_open = (each[box] for each in (*view, open_cells))
    walls = Occupancy(view.evidence).walls(view.prior)[box]
    is_seen = np.abs(evidence) >= SURE
    known = is_seen & is_open

    # The goal by the mark, which may be some cells off.
    near, far = (ndimage.gaussian_filter(mark, cells, mode="constant") for cells in (_NEAR_CELLS, _FAR_CELLS))
    goal = _MARK * mark + _NEAR * near + _FAR * far + _ANYWHERE * is_open / max(1, is_open.sum())
    possible = is_open & ~searched & ~(is_seen & (evidence > 0))
    goal_weight = np.log(np.maximum(goal * (1 - walls * ~is_seen), 1e-9))

    # How wrong the map has been so far, and how much of it was seen.
    wrong = np.abs((evidence > 0) - prior)[known].sum() / (known.sum() + _PRIOR_CELLS)
    share_seen = known.sum() / (known.sum() + 30.0)

    planes = (
        _log_odds(prior) / _SCALE,
        np.clip(evidence, -_LARGEST, _LARGEST) / _SCALE,
        is_seen,
        _log_odds(walls) / _SCALE,
        np.where(known, (evidence > 0) - prior, 0.0),
        mark / mark.max() if mark.any() else mark,
        np.clip(goal_weight - goal_weight.max(), -_LARGEST, 0) / _SCALE,
        searched,
        ~is_open,
        np.full(prior.shape, wrong),
        np.full(prior.shape, share_seen),
    )
    rule = np.stack([_log_odds(walls), goal_weight]).astype(np.float32)
    return Picture(box, walls, np.stack(planes).astype(np.float32), rule, is_open & ~is_seen, possible)


class BeliefNetwork(nn.Module):
    """Corrects the rule's log odds of a wall and log weights of the goal; both corrections are zero at first."""

    def __init__(self, config: Any):
        super().__init__()
        channels = config.channels
        self.inputs = nn.Conv2d(NUM_PLANES, channels, 3, padding=1)
        self.layers = nn.ModuleList(
            nn.Conv2d(channels, channels, 3, padding=dilation, dilation=dilation) for dilation in config.dilations
        )
        self.outputs = nn.Conv2d(channels, 2, 1)
        for parameter in self.outputs.parameters():
            nn.init.zeros_(parameter)

    def forward(self, planes: torch.Tensor, inside: torch.Tensor) -> torch.Tensor:
        """Returns corrections `[B, 2, H, W]` to `WALL` and `GOAL`.

        Args:
          planes: `[B, C, H, W]`.
          inside: `[B, 1, H, W]`, 1 in the views' boxes, 0 where a smaller one is padded; it changes no bit inside.
        """
        features = self.inputs(planes) * inside
        for layer in self.layers:
            features = features + layer(functional.relu(features)) * inside
        return self.outputs(functional.relu(features))


@torch.no_grad()
def believe(network: BeliefNetwork, view: View) -> tuple[np.ndarray, np.ndarray]:
    """Returns the probability of a wall, `[L, L]` float, and that of the goal, `[L, L]` float.

    Where a cell was seen, the probability of a wall is the rule's; where a wall is certain, it is 1. The goal is in no
    cell that was searched or seen to be a wall; if none is left, all are 0.
    """
    seen = picture(view)
    planes = torch.from_numpy(seen.planes)[None]
    logits = (seen.rule + network(planes, planes.new_ones(1, 1, *seen.unseen.shape))[0].numpy()).astype(np.float64)
    walls = np.ones(view.prior.shape)
    walls[seen.box] = np.where(seen.unseen, 1 / (1 + np.exp(-logits[WALL])), seen.walls)
    goal = np.zeros_like(walls)
    if seen.possible.any():
        weights = np.where(seen.possible, np.exp(logits[GOAL] - logits[GOAL][seen.possible].max()), 0.0)
        goal[seen.box] = weights / weights.sum()
    return walls, goal


def _box(is_open: np.ndarray) -> tuple[slice, slice]:
    """Returns the box around the cells that may be free, and a cell around them."""
    sides = (np.flatnonzero(is_open.any(axis=1 - axis)) for axis in (0, 1))
    rows, columns = (slice(max(0, int(s[0]) - 1), int(s[-1]) + 2) if len(s) else slice(0, 1) for s in sides)
    return rows, columns


def _log_odds(probability: np.ndarray) -> np.ndarray:
    """Returns log odds, clipped."""
    clipped = np.clip(probability, _LEAST, 1 - _LEAST)
    return np.clip(np.log(clipped / (1 - clipped)), -_LARGEST, _LARGEST)
