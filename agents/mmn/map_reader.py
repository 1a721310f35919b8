"""Reading of tables that have a row for each cell of a map.

`G` is the number of contexts, `K` of positions in each, `M` the side of the map.
"""

from __future__ import annotations

import math

import torch

from ..common.layers import steepness

REACH = 2  # cells; those that are nearer than this, in rows and in columns, count


def read(position: torch.Tensor, table: torch.Tensor, sharpness: torch.Tensor) -> torch.Tensor:
    """Returns rows of tables `[G, M * M, R]`, interpolated at positions (row, column) `[G, K, 2]`: `[G, K, R]`.

    In each direction, the cells less than two away are weighted by their distance, at most four; the larger
    `sharpness`, a learned number, the more the nearest cell counts.
    """
    size = math.isqrt(table.shape[1])
    position = position.clamp(0, size - 1)
    sharpness = steepness(sharpness)
    if position.shape[1] > 1:  # one product for all positions of a map
        return _outer(_nearness(position, torch.arange(size, device=position.device), sharpness)) @ table
    cells = position.floor()[..., None] + torch.arange(1 - REACH, 1 + REACH, device=position.device)  # [G, 1, 2, 4]
    inside = (cells >= 0) & (cells < size)
    row, column = cells.clamp(0, size - 1).long().unbind(-2)
    index = (row[..., :, None] * size + column[..., None, :]).flatten(1)  # [G, 16]
    index = index + size**2 * torch.arange(len(position), device=position.device)[:, None]
    rows = table.flatten(0, 1).index_select(0, index.flatten()).unflatten(0, index.shape)
    return _outer(_nearness(position, cells, sharpness, inside)) @ rows


def _nearness(
    position: torch.Tensor, cells: torch.Tensor, sharpness: torch.Tensor, inside: torch.Tensor | None = None
) -> torch.Tensor:
    """Returns soft one-hots `[G, K, 2, n]` of positions `[G, K, 2]` over n rows and columns; 0 two or more away."""
    distance = (position[..., None] - cells) ** 2
    near = distance < REACH**2
    if inside is not None:
        near = near & inside
    return torch.softmax((-sharpness * distance).masked_fill(~near, -torch.inf), dim=-1)


def _outer(weight: torch.Tensor) -> torch.Tensor:
    """Returns weights of cells `[G, K, n * n]` from those of rows and columns `[G, K, 2, n]`."""
    return (weight[..., 0, :, None] * weight[..., 1, None, :]).flatten(-2)
