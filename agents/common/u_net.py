"""A U-Net: a convolutional network that reads planes at several scales (Ronneberger et al. 2015).

`B` is the number of inputs, `H` and `W` the cells along their axes.
"""

from __future__ import annotations

import torch
from torch import nn
from torch.nn import functional


class Block(nn.Module):
    """Two convolutions with a way around them."""

    def __init__(self, num_inputs: int, num_outputs: int):
        super().__init__()
        self.layers = nn.Sequential(
            nn.Conv2d(num_inputs, num_outputs, 3, padding=1), nn.GroupNorm(4, num_outputs), nn.ReLU(),
            nn.Conv2d(num_outputs, num_outputs, 3, padding=1), nn.GroupNorm(4, num_outputs),
        )  # fmt: skip
        self.around = nn.Conv2d(num_inputs, num_outputs, 1)

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        return functional.relu(self.around(features) + self.layers(features))


class UNet(nn.Module):
    """Features of 1, 2, 4, ... cells, and back."""

    def __init__(self, num_inputs: int, channels: tuple[int, ...], num_outputs: int):
        """Makes a network with new weights and as many levels as there are `channels`, the numbers of features."""
        super().__init__()
        first, *others = channels
        self.inputs = Block(num_inputs, first)
        self.down = nn.ModuleList(Block(*pair) for pair in zip(channels, others, strict=False))
        self.up = nn.ModuleList(Block(fine + coarse, fine) for fine, coarse in zip(channels, others, strict=False))
        self.outputs = nn.Conv2d(first, num_outputs, 1)

    def forward(self, planes: torch.Tensor) -> torch.Tensor:
        """Returns `[B, num_outputs, H, W]` of planes `[B, num_inputs, H, W]`; 2 to the levels - 1 divides H and W."""
        levels = [self.inputs(planes)]
        for block in self.down:
            levels.append(block(functional.avg_pool2d(levels[-1], 2)))
        features = levels.pop()
        for block in reversed(self.up):
            finer = functional.interpolate(features, scale_factor=2, mode="bilinear", align_corners=False)
            features = block(torch.cat([finer, levels.pop()], dim=1))
        return self.outputs(features)
