"""A network that writes a map: it reads what it wrote around the body and a scan, and changes what it wrote.

Lengths are in cells. The patch is of the cells around the one that the body is in, `S` on a side; `B` is the number of
bodies, `R` of rays.
"""

from __future__ import annotations

import math
import pathlib

import numpy as np
import torch
from torch import nn

from mazebench.world.ray_casting import NUM_RAYS

from ..common.actor import one_torch_thread
from ..common.checkpoint import load_checkpoint, load_into
from ..robot.beams import MOST_EVIDENCE, UNKNOWN

NAME = "scan-walls"
REACH = 3.5  # cells
SIDE = 9  # cells of the patch

_RAY = 2 * math.pi / NUM_RAYS  # rad between two rays
_HIDDEN = 256
_PRIOR = math.log(UNKNOWN / (1 - UNKNOWN))  # log odds of a wall of which nothing was seen


class WallWriter(nn.Module):
    """Layers from the log odds of walls around a body, its place in its cell and a scan, to changes of the log odds."""

    def __init__(self) -> None:
        """Makes a network with new weights, which changes nothing much."""
        super().__init__()
        self.layers = nn.Sequential(
            nn.Linear(NUM_RAYS + 3 + SIDE**2, _HIDDEN), nn.ReLU(), nn.Linear(_HIDDEN, _HIDDEN), nn.ReLU(),
            nn.Linear(_HIDDEN, SIDE**2),
        )  # fmt: skip

    def forward(self, written: torch.Tensor, rows: torch.Tensor) -> torch.Tensor:
        """Returns `[B, S, S]`, the log odds of walls after scans, within `MOST_EVIDENCE` of 0.

        Args:
          written: `[B, S, S]` float32, the log odds before.
          rows: `[B, R + 3]` float32, of `rows_of`.
        """
        changes = self.layers(torch.cat([written.flatten(1) / MOST_EVIDENCE, rows], dim=1)).view_as(written)
        return (written + changes).clamp(-MOST_EVIDENCE, MOST_EVIDENCE)

    def loss(self, written: torch.Tensor, is_wall: torch.Tensor, is_seen: torch.Tensor) -> torch.Tensor:
        """Returns the mean cross-entropy of log odds and truth; where nothing was seen, the log odds should be 0.

        All are `[B, S, S]`, the last two bool: the walls, and the cells that a ray has reached so far.
        """
        wanted = torch.where(is_seen, is_wall.float(), UNKNOWN)
        return nn.functional.binary_cross_entropy_with_logits(written + _PRIOR, wanted)

    @one_torch_thread()
    @torch.no_grad()
    def write(self, evidence: np.ndarray, x: float, y: float, yaw: float, ranges: np.ndarray) -> None:
        """Writes what a scan `[R]` from a pose tells into `evidence` `[L, L]`, the log odds of walls, in place."""
        half, size = SIDE // 2, len(evidence)
        row, column = size - 1 - math.floor(y), math.floor(x)
        around = np.pad(evidence, half)[row : row + SIDE, column : column + SIDE].astype(np.float32)
        rows = rows_of(np.array([[x, y, yaw]]), ranges[None])
        patch = self(torch.from_numpy(around)[None], torch.from_numpy(rows))[0].numpy()
        top, left = max(half - row, 0), max(half - column, 0)
        bottom, right = min(SIDE, size - row + half), min(SIDE, size - column + half)
        inside = slice(row - half + top, row - half + bottom), slice(column - half + left, column - half + right)
        evidence[inside] = patch[top:bottom, left:right]


def rows_of(poses: np.ndarray, ranges: np.ndarray) -> np.ndarray:
    """Returns the inputs `[B, R + 3]` float32 of scans `[B, R]` from `poses` `[B, 3]`: x, y and yaw (rad).

    They are the ranges from the ray on that is nearest to the direction of x, that ray's angle, and the place in the
    cell.
    """
    turned = np.rint(poses[:, 2] / _RAY).astype(np.int64)
    rays = (np.arange(NUM_RAYS) - turned[:, None]) % NUM_RAYS
    aligned = np.take_along_axis(ranges, rays, axis=1) / REACH
    angle = (poses[:, 2] / _RAY - turned)[:, None]
    return np.concatenate([aligned, angle, poses[:, :2] % 1 - 0.5], axis=1).astype(np.float32)


def load(path: pathlib.Path) -> WallWriter:
    """Returns the network of a file; raises `InputError` if that can't be read, or is none of such a network."""
    network = WallWriter()
    load_into(path, network, load_checkpoint(path, NAME)[0])
    return network
