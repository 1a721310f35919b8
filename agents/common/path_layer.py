"""Cheapest paths as a layer of a network: exact, of any size, and differentiable.

The layer solves

    u(n) = min(end(n), min over the 8 neighbours m of n of u(m) + w(m, n)),

the cost of the cheapest way between a goal and cell n, with the cost of n itself: so a wall is far from every goal.
A step w(m, n) costs c(n), and on a diagonal, between the cells a and b, (sqrt(2) - 1/2) c(n) + (c(a) + c(b)) / 4: in
the open a diagonal costs sqrt(2) cells, and no way slips between two walls that touch at a corner. With exp(-u) for
values and exp(-c) for the propagation of cells, this is the fixed point of MVProp (Nardelli et al. 2019) in logarithms,
reached without iterations.

Dijkstra's algorithm finds u and a tree of cheapest ways. u(n) is the sum of the costs along its way. Where no other way
is equally cheap, its gradient counts the cells that the way enters. One pass over the tree, from the far cells to the
near ones, adds up all gradients.
"""

from __future__ import annotations

import heapq
import math
from typing import Any

import numpy as np
import torch
from torch import nn

from mazebench.kernels import compiled

_DIAGONAL = math.sqrt(2.0) - 0.5  # share of the entered cell in the cost of a diagonal step
_CORNER = 0.25  # share of each of the two cells at the corner
_LARGEST = 5.0  # log of the largest cost added to a cell's length of 1: 148 cells
FAR = 1e6  # what it costs to end in a cell that is no goal; more than any way


def cost_layers(num_planes: int, channels: int) -> nn.Sequential:
    """Returns convolutions that give each cell a score `[G, 1, L, L]`, from planes `[G, num_planes, L, L]`."""
    return nn.Sequential(
        nn.Conv2d(num_planes, channels, 3, padding=1), nn.ReLU(), nn.Conv2d(channels, channels, 3, padding=1),
        nn.ReLU(), nn.Conv2d(channels, 1, 1),
    )  # fmt: skip


def cell_costs(scores: torch.Tensor) -> torch.Tensor:
    """Returns the costs of cells with these scores: at least 1, so that far goals are as sharp as near ones.

    Walls grow expensive by a factor, not by a sum.
    """
    return 1 + torch.exp(scores.clamp(max=_LARGEST))


class CheapestWays(torch.autograd.Function):
    """Costs `[G, L, L]` of the cheapest ways, from those of entering cells and of ending in them, always on the CPU."""

    @staticmethod
    def forward(ctx: Any, cost: torch.Tensor, end: torch.Tensor) -> torch.Tensor:
        """Returns u `[G, L, L]` float32, of costs more than 0 and of ends; they are `FAR` where no goal is."""
        least, before, order = _cheapest_ways(cost.detach().cpu().numpy(), end.detach().cpu().numpy())
        ctx.before, ctx.order = before, order
        return torch.from_numpy(least).to(cost.device)

    @staticmethod
    def backward(ctx: Any, *gradients: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Returns the gradients of costs and ends `[G, L, L]`, given that of u."""
        gradient = gradients[0].contiguous()
        found = _gradients(gradient.cpu().numpy(), ctx.before, ctx.order)
        of_cost, of_end = (torch.from_numpy(each).to(gradient.device) for each in found)
        return of_cost, of_end


@compiled
def _cheapest_ways(cost: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns u `[G, L, L]`, then `[G, L * L]` int twice: the cell before each on its way, and cells near to far."""
    num_grids, size, _ = cost.shape
    least = end.copy()
    before = np.empty((num_grids, size * size), np.int32)
    order = np.empty((num_grids, size * size), np.int32)
    for grid in range(num_grids):
        u, c = least[grid], cost[grid]
        before[grid] = np.arange(size * size)
        queue = [(np.float64(u[cell // size, cell % size]), cell) for cell in range(size * size)
                 if u[cell // size, cell % size] < FAR]  # fmt: skip
        heapq.heapify(queue)
        is_done = np.zeros((size, size), np.bool_)
        count = 0
        while queue:
            near, cell = heapq.heappop(queue)
            row, column = cell // size, cell % size
            if is_done[row, column]:
                continue
            is_done[row, column] = True
            order[grid, count] = cell
            count += 1
            for down in (-1, 0, 1):
                for right in (-1, 0, 1):
                    r, k = row + down, column + right
                    if r < 0 or k < 0 or r >= size or k >= size or is_done[r, k]:
                        continue
                    step = c[r, k]
                    if down != 0 and right != 0:
                        step = _DIAGONAL * c[r, k] + _CORNER * (c[row, k] + c[r, column])
                    through = np.float32(near + step)
                    if through < u[r, k]:
                        u[r, k], before[grid, r * size + k] = through, cell
                        heapq.heappush(queue, (np.float64(through), r * size + k))
        order[grid, count:] = -1  # never happens where a goal is: no cost is infinite
    return least, before, order


@compiled
def _gradients(gradient: np.ndarray, before: np.ndarray, order: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns the gradients `[G, L, L]` of costs and of ends, given those of u and the trees."""
    num_grids, size, _ = gradient.shape
    of_cost, of_end = np.zeros(gradient.shape, np.float32), np.zeros(gradient.shape, np.float32)
    for grid in range(num_grids):
        flow = gradient[grid].copy()
        for index in range(size * size - 1, -1, -1):
            cell = order[grid, index]
            if cell < 0:
                continue
            r, k = cell // size, cell % size
            row, column = before[grid, cell] // size, before[grid, cell] % size
            if row == r and column == k:
                of_end[grid, r, k] += flow[r, k]
                continue
            if row == r or column == k:
                of_cost[grid, r, k] += flow[r, k]
            else:
                of_cost[grid, r, k] += _DIAGONAL * flow[r, k]
                of_cost[grid, row, k] += _CORNER * flow[r, k]
                of_cost[grid, r, column] += _CORNER * flow[r, k]
            flow[row, column] += flow[r, k]
    return of_cost, of_end
