"""The network of the map policy: gated convolutions over the map, read around the body, beside the picture.

`G` is the number of maps, `L` of cells on a side of each, `K` of states on each map, `C` of channels. Lengths are in
cells. A pose is x, y and yaw (rad), with x to the right, y up and the map's lower left corner at (0, 0).
"""

from __future__ import annotations

import torch
from torch import nn
from torch.nn import functional

from mazebench.constants import NUM_ACTIONS

from ..common.layers import VELOCITY_UNIT, ring_points, without_exposure

_CHANNELS = 16
_STEPS = 40  # of reading; what a cell knows travels a cell a step
_HIDDEN = 256
_NUM_SEEN = 64  # features of a picture
_POINTS = ring_points((0.5, 1.0, 1.7, 2.5), 8)  # [33, 2], cells


class MapNetwork(nn.Module):
    """Spreads what a map shows from cell to cell; acts by what arrived around the body, and by the picture."""

    def __init__(self) -> None:
        """Makes a network for maps of any size."""
        super().__init__()
        self.inputs = nn.Conv2d(3, _CHANNELS, 3, padding=1)
        self.spread = nn.Conv2d(_CHANNELS, 2 * _CHANNELS, 3, padding=1)  # what is new, and the share of it
        self.eye = nn.Sequential(
            nn.Conv2d(3, 16, 5, stride=2, padding=2), nn.ReLU(), nn.Conv2d(16, 24, 3, stride=2, padding=1), nn.ReLU(),
            nn.Conv2d(24, 32, 3, stride=2, padding=1), nn.ReLU(), nn.Flatten(),
            nn.Linear(32 * 4 * 4, _NUM_SEEN), nn.ReLU(),
        )  # fmt: skip
        self.policy = nn.Sequential(
            nn.Linear(len(_POINTS) * (_CHANNELS + 1) + _NUM_SEEN + 3, _HIDDEN), nn.ReLU(),
            nn.Linear(_HIDDEN, _HIDDEN), nn.ReLU(), nn.Linear(_HIDDEN, NUM_ACTIONS),
        )  # fmt: skip

    def read(self, maps: torch.Tensor) -> torch.Tensor:
        """Returns what is read of maps `[G, 2, L, L]` (walls and goal): `[G, C + 1, L, L]`, the last one the walls."""
        planes = torch.cat([maps, torch.ones_like(maps[:, :1])], dim=1)  # which tells where a map ends
        given = self.inputs(planes)
        features = torch.tanh(given)
        for _ in range(_STEPS):
            new, share = self.spread(features).chunk(2, dim=1)
            features = torch.lerp(features, torch.tanh(new + given), torch.sigmoid(share))
        return torch.cat([features, maps[:, :1]], dim=1)

    def forward(
        self, features: torch.Tensor, pose: torch.Tensor, velocity: torch.Tensor, pictures: torch.Tensor
    ) -> torch.Tensor:
        """Returns logits of actions, `[G, K, 6]`.

        Args:
          features: `[G, C + 1, L, L]`, see `read`.
          pose: `[G, K, 3]`.
          velocity: `[G, K, 2]`, forward and to the left, in m/s.
          pictures: `[G, K, 64, 64, 3]` uint8.
        """
        # The points around each body, from -1 to 1 across the map, and what was read there.
        size, (x, y, yaw) = features.shape[-1], pose[..., None].unbind(2)
        cosine, sine, (ahead, left) = torch.cos(yaw), torch.sin(yaw), _POINTS.T
        columns, rows = x + cosine * ahead - sine * left, size - y - sine * ahead - cosine * left
        points = torch.stack([columns, rows], dim=-1) * (2 / size) - 1  # [G, K, 33, 2]
        near = functional.grid_sample(features, points, padding_mode="border", align_corners=False)

        colors = functional.avg_pool2d(pictures.flatten(0, 1).movedim(-1, 1) / 255, 2)
        seen = self.eye(without_exposure(colors)).unflatten(0, pose.shape[:2])
        speed = torch.linalg.vector_norm(velocity, dim=-1, keepdim=True)
        motion = torch.cat([velocity, speed], dim=-1) / VELOCITY_UNIT
        return self.policy(torch.cat([near.movedim(1, 2).flatten(2), seen, motion], dim=-1))
