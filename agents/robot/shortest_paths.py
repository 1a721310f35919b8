"""Cheapest paths on a grid, by Dijkstra's algorithm.

A grid has `N` x `N` cells, or `N` x `W`; cell (row, column) has the index row * W + column.
"""

from __future__ import annotations

import heapq
from typing import NamedTuple

import numpy as np

from ..common.kernels import compiled


class Ways(NamedTuple):
    """A cheapest way from each cell of a grid to an end."""

    cost: np.ndarray  # [N, N] float, of the way; infinite without one
    following: np.ndarray  # [N * N] int32, the next cell on the way; the cell itself where the way ends


@compiled
def cheapest_ways(entering: np.ndarray, end: np.ndarray) -> Ways:
    """Returns the cheapest ways through cells side by side.

    A step costs what entering the next cell costs. Of equal ways, the one is taken whose next cell is nearer to its
    end, and of these the one whose next cell has the lower index.

    Args:
      entering: `[N, N]` float, the costs of entering each cell, more than 0.
      end: `[N, N]` float, what it costs if the way ends in a cell; infinite where none does.
    """
    height, width = end.shape
    least = end.copy()
    following = np.arange(end.size).astype(np.int32)
    num_done = 0

    # The search begins at the ends. What is popped is settled, so that cells come from near to far.
    queue = [(least[cell // width, cell % width], cell) for cell in range(end.size)]
    heapq.heapify(queue)
    while queue and num_done < end.size:  # costs that are no numbers would be popped again and again
        near, cell = heapq.heappop(queue)
        row, column = cell // width, cell % width
        if near > least[row, column]:
            continue  # a cheaper way was found after this one
        num_done += 1
        for down, right in ((-1, 0), (0, -1), (1, 0), (0, 1)):
            r, c = row + down, column + right
            if 0 <= r < height and 0 <= c < width:
                through = near + entering[row, column]
                if through < least[r, c]:
                    least[r, c], following[r * width + c] = through, cell
                    heapq.heappush(queue, (through, r * width + c))
    return Ways(least, following)
