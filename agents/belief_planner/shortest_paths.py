"""Cheapest paths on grids, with gradients.

`K` is the number of grids, `M` their side.
"""

from __future__ import annotations

import heapq
from typing import Any

import numpy as np
import torch

from ..common.kernels import compiled

_NONE = -1


class _CheapestPaths(torch.autograd.Function):
    """The gradient of a distance is that of the costs along its path."""

    @staticmethod
    def forward(ctx: Any, cost: torch.Tensor, begin: torch.Tensor) -> torch.Tensor:
        arrays = (values.detach().cpu().float().contiguous().numpy() for values in (cost, begin))
        distance, order, following = _search(*arrays)
        ctx.paths = order, following
        return torch.from_numpy(distance).to(cost.device)

    @staticmethod
    def backward(ctx: Any, *gradients: torch.Tensor) -> tuple[torch.Tensor, None]:
        (gradient,) = gradients
        passed = _pass_back(gradient.cpu().float().contiguous().numpy(), *ctx.paths)
        return torch.from_numpy(passed).to(gradient.device), None


def cheapest_paths(cost: torch.Tensor, begin: torch.Tensor) -> torch.Tensor:
    """Returns the least costs `[K, M, M]` from each cell to an end.

    A path goes through cells side by side; it costs `cost` in each of its cells but the last, where it ends at the cost
    `begin`. Gradients reach `cost` only.

    Args:
      cost: `[K, M, M]`, positive.
      begin: `[K, M, M]`, of ending in each cell.
    """
    return _CheapestPaths.apply(cost, begin)


@compiled
def _search(cost: np.ndarray, begin: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns distances; then `[K, M * M]`: the cells from near to far, and the next cell on the path of each."""
    num_grids, size = len(cost), cost.shape[1]
    distance = begin.copy()
    order = np.empty((num_grids, size * size), np.int32)
    following = np.full((num_grids, size * size), _NONE, np.int32)
    for k in range(num_grids):
        here = distance[k]
        queue = [(here[i // size, i % size], i) for i in range(size * size)]
        heapq.heapify(queue)
        done = np.zeros(size * size, np.bool_)
        count = 0
        while count < size * size:
            near, i = heapq.heappop(queue)
            if done[i]:
                continue
            done[i] = True
            order[k, count] = i
            count += 1
            row, column = i // size, i % size
            for down, right in ((-1, 0), (1, 0), (0, -1), (0, 1)):
                r, c = row + down, column + right
                if 0 <= r < size and 0 <= c < size:
                    reached = near + cost[k, r, c]
                    if reached < here[r, c]:
                        here[r, c] = reached
                        following[k, r * size + c] = i
                        heapq.heappush(queue, (reached, r * size + c))
    return distance, order, following


@compiled
def _pass_back(gradient: np.ndarray, order: np.ndarray, following: np.ndarray) -> np.ndarray:
    """Returns the gradients of costs, given those of distances."""
    num_grids, size = len(gradient), gradient.shape[1]
    passed = gradient.copy().reshape(num_grids, size * size)
    for k in range(num_grids):
        for j in range(size * size - 1, -1, -1):
            i = order[k, j]
            if following[k, i] == _NONE:
                passed[k, i] = 0.0  # the path ends here at once, and costs nothing more
            else:
                passed[k, following[k, i]] += passed[k, i]
    return passed.reshape(gradient.shape)
