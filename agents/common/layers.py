"""Layers that the networks of the learned agents share: features of states and of maps, and codes of positions.

`G` is the number of contexts, `K` of states in each, `M` the side of the context, `C` of channels.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import torch
from torch import nn
from torch.nn import functional

from mazebench.world.bodies import SLIDER

NUM_PLANES = 4
NUM_WAVES = 16
_FREQUENCIES = (0.25, 0.5, 1.0, 2.0)  # per metre, octaves
PERIODS = (24.0, 12.0, 6.0, 4.0, 3.0, 2.0, 1.0)  # cells, of the waves that code a position
VELOCITY_UNIT = SLIDER.top_speed  # m/s, with which the shipped checkpoints learned
DISPLACEMENT_UNIT = 5.0  # m, of displacements among the inputs of a network
WAY_UNIT = 10.0  # cells, of ways to the goal
VALUE_UNIT = 10.0  # steps, of action values; outputs of order one then span the values that matter
NUM_PLACE = 6 + 4 * len(PERIODS)
WIDTHS = (0.5, 2.0, 8.0, 32.0)  # square cells, of the bells that code the distance to the goal
NUM_TO_GOAL = 2 + len(WIDTHS)
# Dilations after which a feature of `MapEncoder` sees 5 cells far, or 19, across a 13 x 13 map.
NEAR_DILATIONS, FAR_DILATIONS = (1, 1, 1, 1), (1, 1, 2, 2, 4, 4, 2, 1, 1)
SCALE_RATE = 5.0  # the map's scale is a parameter times it, so that the parameter is of the order of other weights


class MapEncoder(nn.Module):
    """Features of every cell of the map, of the walls and the goal around that cell."""

    def __init__(self, channels: int, dilations: tuple[int, ...]):
        """Stacks one residual 3 x 3 convolution for each of `dilations`; a feature sees their sum and one cell more."""
        super().__init__()
        self.inputs = nn.Conv2d(NUM_PLANES, channels, 3, padding=1)
        self.layers = nn.ModuleList(
            nn.Conv2d(channels, channels, 3, padding=dilation, dilation=dilation) for dilation in dilations
        )

    def forward(self, context: torch.Tensor) -> torch.Tensor:
        """Returns `[G, C, M, M]` of contexts `[G, 4, M, M]`."""
        features = functional.relu(self.inputs(context))
        for layer in self.layers:
            features = features + functional.relu(layer(features))
        return features


def ring_points(radii: Sequence[float], num_angles: int) -> torch.Tensor:
    """Returns points ahead of a body and to its left, `[P, 2]`: the body, then those of rings around it."""
    angles = [number * 2 * math.pi / num_angles for number in range(num_angles)]
    rings = [(radius * math.cos(angle), radius * math.sin(angle)) for radius in radii for angle in angles]
    return torch.tensor([(0.0, 0.0), *rings])


def without_exposure(colors: torch.Tensor) -> torch.Tensor:
    """Returns the colours of pictures `[B, 3, H, W]` from 0 to 1 with mean 0 and deviation 1 in each picture."""
    deviation, mean = torch.std_mean(colors, dim=(1, 2, 3), keepdim=True)
    return (colors - mean) / (deviation + 0.02)


def marked_position(plane: torch.Tensor) -> torch.Tensor:
    """Returns the row and column `[G, 2]` float of the marker in planes `[G, M, M]`; the middle where there is none."""
    size = plane.shape[-1]
    mark, index = plane.flatten(1).max(dim=1)
    position = torch.stack([index // size, index % size], dim=-1).to(plane.dtype)
    return torch.where(mark[:, None] > 0, position, (size - 1) / 2)


def steepness(sharpness: torch.Tensor) -> torch.Tensor:
    """Returns a positive number for a learned one: how fast the weight of a cell falls with its squared distance."""
    return functional.softplus(sharpness + 1.0)


def position_code(position: torch.Tensor, size: int, sharpness: torch.Tensor) -> torch.Tensor:
    """Returns positions `[G, K, 2]` (row, column) as soft one-hots `[G, K, M * M]` over the cells of a map."""
    cells = torch.arange(size, device=position.device)
    distance = (position[..., None] - cells) ** 2  # [G, K, 2, M]
    weight = torch.softmax(-distance * steepness(sharpness), dim=-1)
    # A soft one-hot of the row times one of the column.
    return (weight[..., 0, :, None] * weight[..., 1, None, :]).flatten(-2)


def waves(moved: torch.Tensor) -> torch.Tensor:
    """Returns sines and cosines `[..., 16]` of displacements `[..., 2]` (m), codes of the position within a cell."""
    return _sines(2 * math.pi * moved[..., None] * torch.tensor(_FREQUENCIES, device=moved.device))


def place_code(position: torch.Tensor, marks: torch.Tensor, size: int) -> torch.Tensor:
    """Returns `[G, K, 34]` of positions `[G, K, 2]` (row, column) on a map of `size` cells a side.

    They are the positions and `marks` `[G, 4]`, those of start and goal, from -1 to 1, then waves of the positions.
    """
    places = torch.cat([position, marks[:, None].expand(-1, position.shape[1], -1)], dim=-1)
    of_position = _sines(position[..., None] * (2 * math.pi / torch.tensor(PERIODS, device=position.device)))
    return torch.cat([(places - (size - 1) / 2) * (2 / size), of_position], dim=-1)


def place_weights(any_size: bool) -> torch.Tensor:
    """Returns the weights `[34]` of a place code: 1, or 0 for what depends on the size of the map.

    What stays says where in its cell a position is, and whether row and column of the cell are even.
    """
    of_waves = [period <= 2 or not any_size for period in PERIODS]
    return torch.tensor([not any_size] * 6 + of_waves * 4, dtype=torch.float32)


def goal_code(position: torch.Tensor, goal: torch.Tensor) -> torch.Tensor:
    """Returns `[G, K, 6]`: tens of cells from positions `[G, K, 2]` to goals `[G, 2]`, and bells of the distance."""
    to_goal = goal[:, None] - position
    bells = torch.exp(-(to_goal**2).sum(dim=-1, keepdim=True) / torch.tensor(WIDTHS, device=position.device))
    return torch.cat([to_goal / WAY_UNIT, bells], dim=-1)


def dueling_values(value: torch.Tensor, advantage: torch.Tensor) -> torch.Tensor:
    """Returns action values `[..., A]` in steps of outputs `[..., 1]` and `[..., A]` (Wang et al. 2016, eq. 9)."""
    return VALUE_UNIT * (value + advantage - advantage.mean(dim=-1, keepdim=True))


def state_features(state: torch.Tensor, origin: torch.Tensor) -> torch.Tensor:
    """Returns features `[..., 9]` of states `[..., 12]`.

    They are x and y since `origin` `[..., 2]` (m), the sine and cosine of yaw, three velocities, and x and y again,
    in units of 5 m. The other numbers of a state never vary (docs/task.md).
    """
    yaw = state[..., 5]
    return torch.cat(
        [
            state[..., :2] - origin,
            torch.sin(yaw)[..., None],
            torch.cos(yaw)[..., None],
            state[..., 6:8] / VELOCITY_UNIT,
            state[..., 11:12] / 2.3,
            (state[..., :2] - origin) / DISPLACEMENT_UNIT,
        ],
        dim=-1,
    )


def in_batches(function: Callable[..., Any], size: int, *inputs: torch.Tensor) -> Any:
    """Returns `function` of `inputs` `[B, ...]`, computed on `size` rows at a time, the last ones padded by zeros.

    Its results are tensors `[B, ...]`, or NamedTuples of such.

    PyTorch rounds differently at another batch size. With a fixed one, a row's result depends on the row alone.
    """
    num_rows = len(inputs[0])

    def part(begin: int) -> list[torch.Tensor]:
        rows = [values[begin : begin + size] for values in inputs]
        padding = size - len(rows[0])
        return [torch.cat([row, row.new_zeros(padding, *row.shape[1:])]) for row in rows] if padding else rows

    results = [function(*part(begin)) for begin in range(0, max(num_rows, 1), size)]
    if isinstance(results[0], torch.Tensor):
        return torch.cat(results)[:num_rows]
    return results[0]._make(torch.cat(parts)[:num_rows] for parts in zip(*results, strict=True))


def _sines(phase: torch.Tensor) -> torch.Tensor:
    """Returns sines and cosines `[..., 4 W]` of phases `[..., 2, W]`."""
    return torch.cat([torch.sin(phase), torch.cos(phase)], dim=-1).flatten(-2)
