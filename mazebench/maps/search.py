"""Breadth-first search over the free cells of a maze, compiled: no farther than asked for.

`K` is the number of cells found, `D` the number of their distances.
"""

from __future__ import annotations

import numpy as np

from mazebench.kernels import compiled


@compiled
def search(walls: np.ndarray, source: int, goal: int, farthest: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns the free cells by their distance from one of them, up to the distance of another or the farthest.

    Args:
      walls: `[N, N]` bool, with a closed border.
      source: the cell to begin at, as row * N + column.
      goal: the cell at whose distance the search ends, -1 for none.
      farthest: the largest distance, in cells.

    Returns:
      cells: `[K]` int, as row * N + column; in no order among those at one distance.
      ends: `[D]` int, the number of cells at distance 0, 1, ... or less.
    """
    size = len(walls)
    is_left = ~walls.ravel()
    cells = np.empty(is_left.size, dtype=np.int32)
    ends = np.empty(is_left.size, dtype=np.int32)
    cells[0], is_left[source] = source, False
    begin, count, distance = 0, 1, 0
    while True:
        end = ends[distance] = count
        if distance == farthest or (goal >= 0 and not is_left[goal]):
            break
        for number in range(begin, end):
            for step in (-size, -1, 1, size):
                near = cells[number] + step
                if is_left[near]:
                    is_left[near] = False
                    cells[count] = near
                    count += 1
        if count == end:
            break
        begin, distance = end, distance + 1
    return cells[:count], ends[: distance + 1]


def distances(walls: np.ndarray, source: int, goal: int = -1) -> np.ndarray:
    """Returns the distances of cells, `[N, N]` int32, -1 where `search` does not come; see there."""
    cells, ends = search(walls, source, goal, walls.size)
    found = np.full(walls.shape, -1, dtype=np.int32)
    counts = ends.copy()
    counts[1:] -= ends[:-1]
    found.ravel()[cells] = np.repeat(np.arange(len(ends)), counts)
    return found
