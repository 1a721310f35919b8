"""Cheapest paths on a grid, by Dijkstra's algorithm.

A grid has `N` x `N` cells, or `N` x `W`; cell (row, column) has the index row * W + column.
"""

from __future__ import annotations

import heapq

import numpy as np

from mazebench.kernels import compiled


@compiled
def cheapest_ways(entering: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Returns `[N * N]` int32: the next cell on the cheapest way from each cell; the cell itself where the way ends.

    A step costs what entering the next cell costs. Of equal ways, the one is taken whose next cell is nearer to its
    end, and of these the one whose next cell has the lower index.

    Args:
      entering: `[N, N]` float, the costs of entering each cell, more than 0.
      end: `[N, N]` float, what it costs if the way ends in a cell; infinite where none does.
    """
    height, width = end.shape
    least = end.copy()
    following = np.arange(end.size).astype(np.int32)

    # The search begins at the ends. What is popped is settled, so that cells come from near to far.
    queue = [(least[cell // width, cell % width], cell) for cell in range(end.size)]
    heapq.heapify(queue)
    while queue:
        near, cell = heapq.heappop(queue)
        row, column = cell // width, cell % width
        if near > least[row, column]:
            continue  # a cheaper way was found after this one
        for down, right in ((-1, 0), (0, -1), (1, 0), (0, 1)):
            r, c = row + down, column + right
            if 0 <= r < height and 0 <= c < width:
                through = near + entering[row, column]
                if through < least[r, c]:
                    least[r, c], following[r * width + c] = through, cell
                    heapq.heappush(queue, (through, r * width + c))
    return following
