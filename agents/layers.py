"""What the networks of DQN and MMN share: features of states and maps, and reading a map at a place.

`G` is the number of contexts, `K` of states in each, `M` the side of the context, `C` of channels.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import torch
from torch import nn
from torch.nn import functional

NUM_PLANES = 4
NUM_WAVES = 16
_FREQUENCIES = (0.25, 0.5, 1.0, 2.0)  # per metre; octaves in which what was moved is given


class MapEncoder(nn.Module):
    """Features of every cell of the map, each of which knows of walls and goal around it."""

    def __init__(self, channels: int, dilations: tuple[int, ...]):
        """One residual 3 x 3 convolution for each of `dilations`; a feature sees their sum and one cell more far."""
        super().__init__()
        self.inputs = nn.Conv2d(NUM_PLANES, channels, 3, padding=1)
        self.layers = nn.ModuleList(
            nn.Conv2d(channels, channels, 3, padding=dilation, dilation=dilation) for dilation in dilations
        )

    def forward(self, context: torch.Tensor) -> torch.Tensor:
        """`[G, C, M, M]` from `[G, 4, M, M]`."""
        features = functional.relu(self.inputs(context))
        for layer in self.layers:
            features = features + functional.relu(layer(features))
        return features


def marked_place(plane: torch.Tensor) -> torch.Tensor:
    """`[G, 2]` float: row and column of the mark in one-hot planes `[G, M, M]`."""
    size = plane.shape[-1]
    index = plane.flatten(1).argmax(dim=1)
    return torch.stack([index // size, index % size], dim=-1).to(plane.dtype)


def place_code(place: torch.Tensor, size: int, sharpness: torch.Tensor) -> torch.Tensor:
    """`[G, K, M * M]`: places (row, column) `[G, K, 2]` as soft one-hots over the cells of a map of `size` M."""
    cells = torch.arange(size, device=place.device)
    distance = (place[..., None] - cells) ** 2  # [G, K, 2, M]
    weight = torch.softmax(-distance * functional.softplus(sharpness + 1.0), dim=-1)
    # A soft one-hot of the row times one of the column
    return (weight[..., 0, :, None] * weight[..., 1, None, :]).flatten(-2)


def waves(moved: torch.Tensor) -> torch.Tensor:
    """`[..., 16]`: metres `[..., 2]` as sines and cosines, which tell where in a cell they end."""
    phase = 2 * math.pi * moved[..., None] * torch.tensor(_FREQUENCIES, device=moved.device)
    return torch.cat([torch.sin(phase), torch.cos(phase)], dim=-1).flatten(-2)


def state_features(state: torch.Tensor, origin: torch.Tensor) -> torch.Tensor:
    """`[..., 9]`: x, y since `origin` `[..., 2]` (m), sine and cosine of yaw, three velocities, a fifth of x and y.

    Of the twelve numbers of a state, only these vary: see docs/tasks.md.
    """
    yaw = state[..., 5]
    return torch.cat(
        [
            state[..., :2] - origin,
            torch.sin(yaw)[..., None],
            torch.cos(yaw)[..., None],
            state[..., 6:8] / 3.2,
            state[..., 11:12] / 2.3,
            (state[..., :2] - origin) / 5.0,
        ],
        dim=-1,
    )


def in_batches(function: Callable[..., torch.Tensor], size: int, *inputs: torch.Tensor) -> torch.Tensor:
    """`function` of `inputs` `[B, ...]`, computed on `size` rows at a time, the last ones padded by zeros.

    PyTorch rounds differently at another batch size; so a row's result depends on the row alone.
    """
    num_rows = len(inputs[0])
    padding = -num_rows % size
    padded = [torch.cat([values, values.new_zeros(padding, *values.shape[1:])]) for values in inputs]
    parts = zip(*(values.split(size) for values in padded), strict=True)
    return torch.cat([function(*part) for part in parts])[:num_rows]
