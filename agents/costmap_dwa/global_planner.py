"""The global planner, after NavFn of Nav2: a cheapest path over a costmap, here by A* over eight neighbours."""

from __future__ import annotations

import heapq
import math

import numpy as np

from mazebench.kernels import compiled

from .costmap import cost

_WALLS_NEARBY = 4.0  # times the length of a step beside a wall costs that much more; NavFn's default
_FREED = 2.0  # radii from start and goal, up to which no cell is closed: a robot may stand at a wall


@compiled
def cheapest_path(
    clearance: np.ndarray, cell: float, radius: float, start: tuple[int, int], goal: tuple[int, int]
) -> np.ndarray:
    """Returns the cells (row, column) of a path, `[K, 2]` int; K is 0 if there is none.

    Args:
      clearance: `[n, n]` float, m to the nearest wall.
      cell: m.
      radius: m, of the robot.
      start: the robot's cell.
      goal: its cell.
    """
    n = len(clearance)
    cells_freed = _FREED * radius / cell
    least = np.full(n * n, np.inf)
    before = np.full(n * n, -1, dtype=np.int32)
    first, last = start[0] * n + start[1], goal[0] * n + goal[1]
    least[first] = 0.0
    queue = [(math.hypot(start[0] - goal[0], start[1] - goal[1]), first)]
    while queue:
        bound, index = heapq.heappop(queue)
        if index == last:
            break
        row, column = index // n, index % n
        if bound > least[index] + math.hypot(row - goal[0], column - goal[1]) + 1e-9:
            continue  # a cheaper way was found after this one
        for down in (-1, 0, 1):
            for right in (-1, 0, 1):
                r, c = row + down, column + right
                if not (0 <= r < n and 0 <= c < n):
                    continue
                if clearance[r, c] < radius:
                    from_start = math.hypot(r - start[0], c - start[1])
                    if clearance[r, c] <= 0 or min(from_start, math.hypot(r - goal[0], c - goal[1])) > cells_freed:
                        continue
                step = math.hypot(down, right) * (1 + _WALLS_NEARBY * cost(clearance[r, c], radius))
                through, to = least[index] + step, r * n + c
                if through < least[to]:
                    least[to], before[to] = through, index
                    heapq.heappush(queue, (through + math.hypot(r - goal[0], c - goal[1]), to))

    count, index = 0, last if np.isfinite(least[last]) else -1
    path = np.empty((n * n if index >= 0 else 0, 2), dtype=np.int32)
    while index >= 0:
        path[count] = index // n, index % n
        count, index = count + 1, before[index]
    return path[:count][::-1]
