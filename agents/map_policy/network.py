"""The network of the map policy: gated convolutions over the map, read around the body, beside the picture.

`G` is the number of maps, `L` of cells on a side of each, `K` of states, `P` of points around the body, `C` of
channels. Lengths are in cells.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import nn
from torch.nn import functional

from mazebench.constants import NUM_ACTIONS

from ..neural_planner.network import NUM_MOTION, Situation, around

PICTURE_SIZE = 32  # pixels a side of the pictures that are read
_NUM_PLANES = 2  # walls and the goal
_RADII = (0.5, 1.0, 1.7, 2.5)  # cells, of rings of points around the body
_ANGLES = 8  # points of a ring
_POINTS = torch.tensor(  # [P, 2], the body, then points ahead of it and to its left
    [(0.0, 0.0)]
    + [
        (radius * math.cos(angle * 2 * math.pi / _ANGLES), radius * math.sin(angle * 2 * math.pi / _ANGLES))
        for radius in _RADII
        for angle in range(_ANGLES)
    ]
)
_NUM_SEEN = 64  # features of a picture


class Reading(NamedTuple):
    """What is read of `G` maps."""

    features: torch.Tensor  # [G, L * L, C + 1] float32, of each cell, and whether it is a wall


class MapNetwork(nn.Module):
    """Spreads what a map shows from cell to cell, and acts by what arrives around the body and by the picture."""

    plan_class = Reading

    def __init__(self, channels: int, steps: int, hidden: int):
        """A cell's features depend on the cells that are up to `steps` away; `hidden` units are those of the policy."""
        super().__init__()
        self._steps = steps
        self.inputs = nn.Conv2d(_NUM_PLANES + 1, channels, 3, padding=1)
        self.spread = nn.Conv2d(channels, 2 * channels, 3, padding=1)  # what is new, and how much of it is taken
        self.eye = nn.Sequential(
            nn.Conv2d(3, 16, 5, stride=2, padding=2), nn.ReLU(), nn.Conv2d(16, 24, 3, stride=2, padding=1), nn.ReLU(),
            nn.Conv2d(24, 32, 3, stride=2, padding=1), nn.ReLU(), nn.Flatten(),
            nn.Linear(32 * (PICTURE_SIZE // 8) ** 2, _NUM_SEEN), nn.ReLU(),
        )  # fmt: skip
        num_features = len(_POINTS) * (channels + 1) + _NUM_SEEN + NUM_MOTION
        self.policy = nn.Sequential(
            nn.Linear(num_features, hidden), nn.ReLU(), nn.Linear(hidden, hidden), nn.ReLU(),
            nn.Linear(hidden, NUM_ACTIONS),
        )  # fmt: skip
        self.value = nn.Sequential(nn.Linear(num_features, hidden // 2), nn.ReLU(), nn.Linear(hidden // 2, 1))

    def plan(self, maps: torch.Tensor) -> Reading:
        """Returns what is read of maps `[G, 2, L, L]` uint8: walls and the goal, 255 where one is."""
        planes = maps / 255.0
        planes = torch.cat([planes, torch.ones_like(planes[:, :1])], dim=1)  # which also tells the maps' edges
        given = self.inputs(planes)
        features = torch.tanh(given)
        for _ in range(self._steps):
            new, share = self.spread(features).chunk(2, dim=1)
            features = torch.lerp(features, torch.tanh(new + given), torch.sigmoid(share))
        return Reading(torch.cat([features, planes[:, :1]], dim=1).flatten(2).transpose(1, 2))

    @staticmethod
    def scalars(reading: Reading) -> dict[str, torch.Tensor]:
        """Returns what a learner logs of a reading, by name: nothing."""
        return {}

    def forward(self, reading: Reading, grid: torch.Tensor, situation: Situation) -> tuple[torch.Tensor, torch.Tensor]:
        """Returns logits `[K, 6]` and values `[K]` of states on the maps `grid` (`[K]` int) of a reading."""
        num_cells = reading.features.shape[1]
        corners, weights = around(situation.pose, _POINTS, math.isqrt(num_cells))
        cells = reading.features.flatten(0, 1)
        near = sum(
            weight[..., None] * functional.embedding(grid[:, None] * num_cells + corner, cells)
            for corner, weight in zip(corners, weights, strict=True)
        )
        seen = self.eye(situation.sight.movedim(-1, 1) / 127.5 - 1)
        features = torch.cat([near.flatten(1), seen, situation.motion], dim=1)  # type: ignore[union-attr]
        return self.policy(features), self.value(features)[:, 0]
