"""The belief over a maze: for each cell, the probability that it is wall, and that the goal is in it.

`G` is the number of contexts, `M` the side of the map.
"""

from __future__ import annotations

import torch
from torch import nn
from torch.nn import functional

from .evidence import FAILED, PASSED, SENSED

NUM_PLANES = 2
WALL, GOAL = range(NUM_PLANES)  # the planes of a maze with its goal: as it is shown, as it is believed, as it is

_DILATIONS = (1, 1, 2, 2, 4, 4, 1, 1)  # of the convolutions
# Logits before anything is learned: of what is shown, of what is sensed, and of the goal where it is shown.
_SHOWN, _SENSED, _SHOWN_GOAL = 6.0, 12.0, 10.0
_NUM_READ = 2  # planes of evidence that the network reads: SENSED and PASSED
_NUM_INPUTS = NUM_PLANES + _NUM_READ + 3  # how much is sensed of each cell, and whether row and column are odd
_PRIOR = 4.0  # observations that the network's estimate of a wall counts for
_LEAST_FREE = 1e-6  # probability that a cell is free
_SENSED_WEIGHT = 9.0  # of a sensed cell in the loss, beside the 1 of all cells: there, the map can be caught out


class Belief(nn.Module):
    """Weighs the shown map against the evidence; before anything is learned, it trusts both, and the evidence more."""

    def __init__(self, channels: int):
        super().__init__()
        self.trust = nn.Parameter(torch.tensor([_SHOWN, _SENSED, _SHOWN_GOAL, _SHOWN_GOAL]))
        self.inputs = nn.Conv2d(_NUM_INPUTS, channels, 3, padding=1)
        self.layers = nn.ModuleList(
            nn.Conv2d(channels, channels, 3, padding=dilation, dilation=dilation) for dilation in _DILATIONS
        )
        self.outputs = nn.Conv2d(channels, NUM_PLANES, 1)
        for parameter in self.outputs.parameters():
            nn.init.zeros_(parameter)

    def forward(self, shown: torch.Tensor, evidence: torch.Tensor) -> torch.Tensor:
        """Returns logits `[G, 2, M, M]`: that a cell is wall; and of a softmax over cells, that the goal is in it.

        Args:
          shown: `[G, 2, M, M]`, the map, and the goal's mark.
          evidence: `[G, 3, M, M]`, of the episode.
        """
        odd = torch.arange(shown.shape[-1], device=shown.device) % 2
        lattice = torch.stack(torch.broadcast_tensors(odd[:, None], odd)).to(shown.dtype)
        known = evidence[:, SENSED : SENSED + 1].abs()
        read = evidence[:, :_NUM_READ]
        features = self.inputs(torch.cat([shown, read, known, lattice.expand(len(shown), -1, -1, -1)], dim=1))
        for layer in self.layers:
            features = features + layer(functional.relu(features))
        of_map, of_sensed, of_goal, of_passed = self.trust
        wall = of_map * (2 * shown[:, WALL] - 1) + of_sensed * evidence[:, SENSED]
        goal = of_goal * shown[:, GOAL] - of_passed * evidence[:, PASSED]
        return torch.stack([wall, goal], dim=1) + self.outputs(functional.relu(features))


def probabilities(logits: torch.Tensor, evidence: torch.Tensor) -> torch.Tensor:
    """Returns `[G, 2, M, M]`: the probability of wall, and that of the goal as a share of its most probable cell's.

    The goal is in no wall. Each step in which a cell stopped the body counts as one observation of a wall, beside the
    network's estimate, which counts as four: the mean of a beta distribution. The network reads no count of them.

    Args:
      logits: `[G, 2, M, M]`, of `Belief`.
      evidence: `[G, 3, M, M]`, from which they were computed.
    """
    failed = evidence[:, FAILED]
    wall = (_PRIOR * torch.sigmoid(logits[:, WALL]) + failed) / (_PRIOR + failed)
    goal = logits[:, GOAL] + torch.log((1 - wall).clamp(min=_LEAST_FREE))
    return torch.stack([wall, torch.exp(goal - goal.amax(dim=(-2, -1), keepdim=True))], dim=1)


def belief_losses(logits: torch.Tensor, sensed: torch.Tensor, truth: torch.Tensor) -> torch.Tensor:
    """Returns the cross-entropies of wall and of goal, `[2]`, means over the contexts.

    Args:
      logits: `[G, 2, M, M]`, of `Belief`.
      sensed: `[G, M, M]`, the evidence from -1 to 1.
      truth: `[G, 2, M, M]`, 1 where the maze has a wall, 1 where its goal is.
    """
    weight = 1 + _SENSED_WEIGHT * sensed.abs()
    errors = functional.binary_cross_entropy_with_logits(logits[:, WALL], truth[:, WALL], reduction="none")
    of_wall = (weight * errors).sum() / weight.sum()
    of_goal = functional.cross_entropy(logits[:, GOAL].flatten(1), truth[:, GOAL].flatten(1))
    return torch.stack([of_wall, of_goal])
