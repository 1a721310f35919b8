"""The eight rotations and mirror images of a navigation task, as free training data.

If the map is turned, displacements and headings turn with it, and a mirror image swaps left and right in velocities and
actions. The result is an experience that could have been collected in the turned maze.
"""

from __future__ import annotations

import numpy as np
import torch

NUM_SYMMETRIES = 8
# Strafing and looking, left and right swapped.
_MIRRORED_ACTIONS = np.array([0, 1, 3, 2, 5, 4])


def turn_planes(planes: torch.Tensor, symmetry: int) -> torch.Tensor:
    """Returns planes `[..., M, M]`, mirrored by symmetries 4 to 7, then turned left `symmetry % 4` times."""
    if symmetry >= 4:
        planes = planes.flip(-1)
    return torch.rot90(planes, symmetry % 4, (-2, -1))


def turn_features(features: torch.Tensor, symmetry: int) -> torch.Tensor:
    """Returns state features `[..., 9]` (see `layers.state_features`) as they are in the turned world."""
    x, y, sine, cosine, forward, left, yaw_rate, far_x, far_y = features.unbind(-1)
    if symmetry >= 4:
        x, far_x, cosine, left, yaw_rate = -x, -far_x, -cosine, -left, -yaw_rate
    for _ in range(symmetry % 4):
        x, y, far_x, far_y, sine, cosine = -y, x, -far_y, far_x, cosine, -sine
    return torch.stack([x, y, sine, cosine, forward, left, yaw_rate, far_x, far_y], dim=-1)


def turn_cells(cells: torch.Tensor, size: int, symmetry: int) -> torch.Tensor:
    """Returns cells (row, column) `[..., 2]` of a map of `size` cells a side as they are on the turned map."""
    row, column = cells.unbind(-1)
    if symmetry >= 4:
        column = size - 1 - column
    for _ in range(symmetry % 4):
        row, column = size - 1 - column, row
    return torch.stack([row, column], dim=-1)


def turn_actions(actions: np.ndarray, symmetry: int) -> np.ndarray:
    """Returns the actions that have the effect of `actions` in the turned world."""
    return _MIRRORED_ACTIONS[actions] if symmetry >= 4 else actions
