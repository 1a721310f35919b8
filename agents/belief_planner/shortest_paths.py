"""Gradients of the costs of cheapest paths.

`K` is the number of grids, `M` their side.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from ..common.kernels import compiled
from ..robot.shortest_paths import cheapest_ways


def cheapest_paths(cost: torch.Tensor, begin: torch.Tensor) -> torch.Tensor:
    """Returns the least costs `[K, M, M]` from each cell to an end.

    A path goes through cells side by side; it costs `cost` in each of its cells but the last, where it ends at the cost
    `begin`. Gradients reach `cost` only.

    Args:
      cost: `[K, M, M]`, positive.
      begin: `[K, M, M]`, of ending in each cell.
    """
    return _CheapestPaths.apply(cost, begin)


class _CheapestPaths(torch.autograd.Function):
    """The gradient of a distance is that of the costs along its path."""

    @staticmethod
    def forward(ctx: Any, cost: torch.Tensor, begin: torch.Tensor) -> torch.Tensor:
        arrays = (values.detach().cpu().float().contiguous().numpy() for values in (cost, begin))
        distance, *ctx.paths = _cheapest_ways(*arrays)
        return torch.from_numpy(distance).to(cost.device)

    @staticmethod
    def backward(ctx: Any, *gradients: torch.Tensor) -> tuple[torch.Tensor, None]:
        (gradient,) = gradients
        passed = _pass_back(gradient.cpu().float().contiguous().numpy(), *ctx.paths)
        return torch.from_numpy(passed).to(gradient.device), None


@compiled
def _cheapest_ways(leaving: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns the parts of `Ways` of K grids, `[K, M, M]` and twice `[K, M * M]`; entering a cell costs nothing."""
    num_grids, size = end.shape[:2]
    cost, entering = np.empty_like(end), np.zeros_like(end[0])
    following, order = np.empty((2, num_grids, size * size), np.int32)
    for k in range(num_grids):
        cost[k], following[k], order[k] = cheapest_ways(entering, leaving[k], end[k])
    return cost, following, order


@compiled
def _pass_back(gradient: np.ndarray, following: np.ndarray, order: np.ndarray) -> np.ndarray:
    """Returns the gradients `[K, M, M]` of costs, given those of distances.

    `following` and `order` are `[K, M * M]` int, as in `Ways`.
    """
    num_grids, num_cells = order.shape
    passed = gradient.copy().reshape(num_grids, num_cells)
    for k in range(num_grids):
        for cell in order[k, ::-1]:  # from far to near
            if following[k, cell] == cell:
                passed[k, cell] = 0.0  # the path ends here at once, and costs nothing more
            else:
                passed[k, following[k, cell]] += passed[k, cell]
    return passed.reshape(gradient.shape)
