"""Ways on a grid of cells of which some are known: what is seen, the cheapest path, and steps to the goal.

`N` is the number of cells on a side, `D` the number of doors. Cells have a flat index, row N + column.
"""

from __future__ import annotations

import heapq

import numpy as np

from mazebench.kernels import compiled
from mazebench.maps.maze import Cell

UNKNOWN, FREE, WALL = -1, 0, 1  # what is known of a cell
FAR = 1e6  # steps, where no way leads
_THROUGH_WALL = 60.0  # cells that a shown wall without a door costs: longer than almost any way around


@compiled
def steps_to(walls: np.ndarray, goal: int) -> np.ndarray:
    """Returns `[N * N]` float: the steps from each cell of `walls` `[N, N]` to the goal; `FAR` if none lead there."""
    size = walls.shape[1]
    steps, queue = np.full(walls.size, FAR), np.empty(walls.size, np.int64)
    steps[goal], queue[0] = 0.0, goal
    begin, end = 0, 1
    while begin < end:
        cell = queue[begin]
        begin += 1
        for down, right in ((-1, 0), (0, -1), (1, 0), (0, 1)):
            row, column = cell // size + down, cell % size + right
            if not walls[row, column] and steps[row * size + column] == FAR:
                steps[row * size + column] = steps[cell] + 1
                queue[end] = row * size + column
                end += 1
    return steps


def cheapest_path(
    known: np.ndarray, shown: np.ndarray, door: np.ndarray, prices: np.ndarray, start: Cell, goal: Cell
) -> np.ndarray:
    """Returns the cells of the cheapest path between two cells, as `path_of` does."""
    size = shown.shape[1]
    return path_of(known, shown, door, prices, start[0] * size + start[1], goal[0] * size + goal[1], -1)


@compiled
def path_of(
    known: np.ndarray, shown: np.ndarray, door: np.ndarray, prices: np.ndarray, start: int, goal: int, avoided: int
) -> np.ndarray:
    """Returns the cells of the cheapest path over what is known, and shown elsewhere; the start alone if there is none.

    Args:
      known: `[N, N]` int8; walls are never entered.
      shown: `[N, N]` bool, the map.
      door: `[N, N]` int, the number of the door that a cell belongs to, or -1.
      prices: `[D]` float, cells that an unknown door costs beside its length.
      start, goal: the first cell and the last one.
      avoided: a door that costs as much as a wall, or -1.
    """
    height, size = shown.shape
    least, following = np.full(shown.size, np.inf), np.full(shown.size, -1)
    least[goal] = 0.0
    queue = [(0.0, goal)]
    while queue:
        near, cell = heapq.heappop(queue)
        if cell == start:
            break
        if near > least[cell]:
            continue
        row, column = cell // size, cell % size
        number = door[row, column]
        through = near + 1.0
        if known[row, column] == UNKNOWN:
            if number >= 0:
                through += _THROUGH_WALL if number == avoided else prices[number]
            elif shown[row, column]:
                through += _THROUGH_WALL
        for down, right in ((-1, 0), (0, -1), (1, 0), (0, 1)):
            r, c = row + down, column + right
            if not (0 < r < height - 1 and 0 < c < size - 1) or known[r, c] == WALL:
                continue
            if through < least[r * size + c]:
                least[r * size + c], following[r * size + c] = through, cell
                heapq.heappush(queue, (through, r * size + c))
    cells, cell = [start], start
    while following[cell] >= 0:
        cell = following[cell]
        cells.append(cell)
    return np.array(cells)


def lines_of_sight(reach: float) -> np.ndarray:
    """Returns `[K, M, 2]` int: cells from one to each that is within `reach` cells, then zeros, as (down, right)."""
    most = int(reach) + 1
    offsets = [
        (down, right)
        for down in range(-most, most + 1)
        for right in range(-most, most + 1)
        if 0 < np.hypot(down, right) <= reach + 0.5
    ]
    lines = np.zeros((len(offsets), most, 2), np.int64)
    for line, offset in zip(lines, offsets, strict=True):
        count = np.abs(offset).max()
        line[:count] = np.rint(np.outer(np.arange(1, count + 1) / count, offset))
    return lines


@compiled
def look(walls: np.ndarray, known: np.ndarray, shown: np.ndarray, cell: int, lines: np.ndarray) -> bool:
    """Adds the cells of a building that are seen from one to `known`; returns whether one is not as it is shown."""
    height, size = walls.shape
    row, column = cell // size, cell % size
    known[row, column] = FREE
    differs = False
    for line in lines:
        for down, right in line:
            if down == 0 and right == 0:
                break
            r, c = row + down, column + right
            if not (0 <= r < height and 0 <= c < size):
                break
            if known[r, c] == UNKNOWN:
                known[r, c] = WALL if walls[r, c] else FREE
                differs |= walls[r, c] != shown[r, c]
            if walls[r, c]:
                break
    return differs


@compiled
def drive(
    walls: np.ndarray, known: np.ndarray, shown: np.ndarray, door: np.ndarray, prices: np.ndarray, path: np.ndarray,
    goal: int, most: float, lines: np.ndarray,
) -> float:  # fmt: skip
    """Returns the steps to the goal in a building, of one who plans anew when a cell is not as it is shown.

    It begins along `path`. If it takes more than `most` steps, it gives up after these. `known` changes in place.
    """
    size = shown.shape[1]
    cell, index, steps = path[0], 0, 0.0
    look(walls, known, shown, cell, lines)
    for _ in range(8 * shown.size):
        if cell == goal or steps > most:
            break
        blocked = index + 1 >= len(path)
        for ahead in path[index + 1 : index + 6]:
            blocked |= known[ahead // size, ahead % size] == WALL
        if blocked:
            path, index = path_of(known, shown, door, prices, cell, goal, -1), 0
            if len(path) < 2:
                return most + 1
        following = path[index + 1]
        if walls[following // size, following % size]:
            known[following // size, following % size] = WALL
            continue
        cell, index, steps = following, index + 1, steps + 1
        if look(walls, known, shown, cell, lines):
            path, index = path_of(known, shown, door, prices, cell, goal, -1), 0
    return steps
