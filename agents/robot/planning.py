"""The path of least expected cost over cells that may be walls, to a goal that may be one of several.

Dijkstra's algorithm plans anew from the goals whenever the estimate changes. At these sizes that takes less than a
millisecond, so D* Lite (Koenig & Likhachev 2002) would save nothing. `N` is the number of cells on a side.
"""

from __future__ import annotations

import heapq

import numpy as np

from mazebench.kernels import compiled
from mazebench.maps.maze import Cell

# What a cell that may be a wall costs beside its length, in metres: the larger one of two answers to the Canadian
# traveller's problem (Papadimitriou & Yannakakis 1991), which were chosen on train mazes.
_RISK = 3.0  # times minus the log that it is free: by so much, a path may be longer to be open e times as probably
_DETOUR = 1.0  # times the odds that it is a wall: what a failed try costs. It keeps the robot from trying shown walls
_GOAL_DETOUR = 3.0  # m by which a goal that is half as likely as another must be nearer to be searched before it
_CLOSED = 1e4  # m; what a certain wall costs, longer than any way around
_UNLIKELY = 1e-9  # of the likeliest goal's probability, up to which a goal is too far to be searched on any map


def plan(
    walls: np.ndarray, goal: np.ndarray, start: Cell, cell_size: float = 1.0, waits: np.ndarray | None = None
) -> list[Cell]:
    """Returns the cells of a cheapest path from `start` to one of the goals.

    Args:
      walls: `[N, N]` float, the probability of a wall; 1 for walls that are never tried.
      goal: `[N, N]` float, how likely a cell is the goal, not zero everywhere.
      start: the cell of the body.
      cell_size: m.
      waits: `[N, N]` float, metres that closed passages cost, infinite elsewhere; None if there are none.
    """
    if waits is not None:
        walls = np.where(waits < _CLOSED, 0.0, walls)
    # Outside of the box around what may be free, there is no way.
    top, bottom, left, right = _box(walls, *start)
    walls, goal = walls[top:bottom, left:right], goal[top:bottom, left:right]

    # Entering a cell costs more the likelier it is a wall.
    free = np.maximum(1 - walls, 1e-9)
    entering = np.where(walls < 1, cell_size + np.maximum(-_RISK * np.log(free), _DETOUR * walls / free), _CLOSED)

    if waits is not None:
        box = waits[top:bottom, left:right]
        entering += np.where(box < _CLOSED, box, 0.0)

    # Ending in a cell costs more the likelier the goal is elsewhere.
    end = np.full(goal.shape, np.inf)
    possible = goal > _UNLIKELY * goal.max()
    end[possible] = _GOAL_DETOUR * (goal.max() / goal[possible] - 1)

    rows, columns = _way_from(entering, end, start[0] - top, start[1] - left)
    return list(zip((rows + top).tolist(), (columns + left).tolist(), strict=True))


@compiled
def _box(walls: np.ndarray, row: int, column: int) -> tuple[int, int, int, int]:
    """Returns the first row and the one after the last, and likewise columns, of what may be free and of a cell."""
    top, bottom, left, right = row, row + 1, column, column + 1
    for r in range(walls.shape[0]):
        for c in range(walls.shape[1]):
            if walls[r, c] < 1:
                top, bottom, left, right = min(top, r), max(bottom, r + 1), min(left, c), max(right, c + 1)
    return top, bottom, left, right


@compiled
def _way_from(entering: np.ndarray, end: np.ndarray, row: int, column: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns the rows and the columns of the cells on the cheapest way from a cell, which is the first one."""
    width = end.shape[1]
    cell = row * width + column
    following = cheapest_ways(entering, end, cell)
    cells = [cell]
    while following[cell] != cell:
        cell = following[cell]
        cells.append(cell)
    return np.array(cells) // width, np.array(cells) % width


@compiled
def cheapest_ways(entering: np.ndarray, end: np.ndarray, first: int = -1) -> np.ndarray:
    """Returns `[N * W]` int32: the index of the next cell on the cheapest way from each, which is its own at the end.

    If `first` is the index of a cell, only the ways from it and from the cells on its way are found.

    A step costs what entering the next cell costs. Of equal ways, the one is taken whose next cell is nearer to its
    end, and of these the one whose next cell has the lower index.

    Args:
      entering: `[N, W]` float, the costs of entering each cell, more than 0.
      end: `[N, W]` float, what it costs if the way ends in a cell; infinite where none does.
    """
    height, width = end.shape
    least = end.copy()
    following = np.arange(end.size).astype(np.int32)

    # The search begins at the ends. What is popped is settled, so that cells come from near to far.
    queue = [
        (end[cell // width, cell % width], cell)
        for cell in range(end.size)
        if end[cell // width, cell % width] < np.inf
    ]
    heapq.heapify(queue)
    while queue:
        near, cell = heapq.heappop(queue)
        row, column = cell // width, cell % width
        if near > least[row, column]:
            continue  # a cheaper way was found after this one
        if cell == first:
            break
        for down, right in ((-1, 0), (0, -1), (1, 0), (0, 1)):
            r, c = row + down, column + right
            if 0 <= r < height and 0 <= c < width:
                through = near + entering[row, column]
                if through < least[r, c]:
                    least[r, c], following[r * width + c] = through, cell
                    heapq.heappush(queue, (through, r * width + c))
    return following
