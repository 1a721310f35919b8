"""Where to go: the path of least expected cost over cells that may be walls, to a goal that may be one of several.

Dijkstra's algorithm plans anew from the goals whenever the estimate changes. At these sizes that takes less than a
millisecond, so D* Lite (Koenig & Likhachev 2002) would save nothing. `N` is the number of cells on a side.
"""

from __future__ import annotations

import heapq

import numpy as np

from mazebench.maps.maze import Cell

from ..common.kernels import compiled

# Cells: what a try of a cell costs if it turns out to be a wall (Canadian traveller's problem, Papadimitriou &
# Yannakakis 1991). A try pays if what it saves, times the chance that the cell is free, is more than this times the
# chance that it is not. So a cell costs 1, and this times the odds of a wall.
_DETOUR = 2.0
_GOAL_DETOUR = 3.0  # cells by which a goal that is half as likely as another must be nearer to be searched before it
_LARGEST_COST = 1e4  # cells; of a certain wall
_UNLIKELY = 1e-9  # of the likeliest goal's probability, up to which a goal is too far to be searched on any map


def cell_costs(walls: np.ndarray) -> np.ndarray:
    """Returns `[N, N]` float: what entering a cell costs, in cells, by its probability of being a wall `[N, N]`."""
    odds = walls / np.maximum(1 - walls, 1e-9)
    return np.minimum(1 + _DETOUR * odds, _LARGEST_COST)


def plan(walls: np.ndarray, goal: np.ndarray, start: Cell) -> list[Cell]:
    """Returns the cells of a cheapest path from `start` to one of the goals.

    Args:
      walls: `[N, N]` float, the probability of a wall.
      goal: `[N, N]` float, how likely a cell is the goal, not zero everywhere.
      start: the cell of the body.
    """
    size, cell = len(walls), start[0] * len(walls) + start[1]
    left_at_goal = np.full(goal.shape, np.inf)
    possible = goal > _UNLIKELY * goal.max()
    left_at_goal[possible] = _GOAL_DETOUR * (goal.max() / goal[possible] - 1)
    next_cell = ways_to_goal(cell_costs(walls), left_at_goal, cell)
    path = [start]
    while next_cell[cell] != cell:
        cell = int(next_cell[cell])
        path.append((cell // size, cell % size))
    return path


@compiled
def ways_to_goal(costs: np.ndarray, left_at_goal: np.ndarray, start: int) -> np.ndarray:
    """Returns `[N * N]` int: the next cell on a cheapest way to a goal, the cell itself where the way ends.

    Cells are numbered row * N + column. The search begins at the goals and ends at `start`, so that only cells nearer
    to a goal than `start` are right.

    Args:
      costs: `[N, N]` float, of entering a cell.
      left_at_goal: `[N, N]` float, the cost that is left at a goal; infinite elsewhere.
      start: the number of a cell.
    """
    size = len(costs)
    total = left_at_goal.copy().ravel()
    next_cell = np.arange(size * size)
    queue = [(0.0, 0) for _ in range(0)]  # typed by what it would hold
    for cell in range(size * size):
        if np.isfinite(total[cell]):
            heapq.heappush(queue, (total[cell], cell))
    while queue:
        cost, cell = heapq.heappop(queue)
        if cell == start:
            break
        if cost > total[cell]:
            continue
        row, column = cell // size, cell % size
        through = cost + costs[row, column]  # of a neighbour that goes through this cell
        for step in range(4):
            other_row = row + (step == 2) - (step == 0)
            other_column = column + (step == 3) - (step == 1)
            if 0 <= other_row < size and 0 <= other_column < size:
                other = other_row * size + other_column
                if through < total[other]:
                    total[other], next_cell[other] = through, cell
                    heapq.heappush(queue, (through, other))
    return next_cell
