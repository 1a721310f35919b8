"""A robot on the grid that believes its map: the shortest ways on the map, and what it drives in the building.

It goes from cell to cell by a shortest 4-connected way on its map, sees the cells around it, corrects the map and plans
again where the map was wrong.

`P` is the number of pairs of a start and a goal, `K` of cells in sight and `W` of cells on ways. Cells are numbers,
row * N + column.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from mazebench.kernels import compiled

_TOLERANCE = 1e-6  # cells


def sight_lines(reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Returns the cells at most `reach` cells away, in an order in which those behind a cell follow it.

    Lines of sight lead from cell to cell, so that they form a tree. A wall hides all cells behind it.

    Returns:
      offsets: `[K, 2]` int, rows and columns from the robot's cell, which is the first.
      after: `[K]` int, the index of the first cell that is not behind the cell.
    """
    longest = math.floor(reach + _TOLERANCE)
    behind: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for row, column in np.ndindex(2 * longest + 1, 2 * longest + 1):
        row, column = row - longest, column - longest
        if 0 < row**2 + column**2 <= (reach + _TOLERANCE) ** 2:
            # One step back along the longer axis, and to the nearest cell of the line along the other one.
            steps = max(abs(row), abs(column))
            before = round(row * (steps - 1) / steps), round(column * (steps - 1) / steps)
            behind.setdefault(before, []).append((row, column))

    # Each cell, then those behind it; a cell's number of cells on and behind it is known once they are.
    offsets, left = [], [(0, 0)]
    num_from: dict[tuple[int, int], int] = {}
    while left:
        offsets.append(left.pop())
        left += behind.get(offsets[-1], [])
    for cell in reversed(offsets):
        num_from[cell] = 1 + sum(num_from[each] for each in behind.get(cell, []))
    return np.array(offsets), np.arange(len(offsets)) + [num_from[cell] for cell in offsets]


@compiled
def plan(
    walls: np.ndarray, start: int, goal: int, cost: np.ndarray, came: np.ndarray, now: np.ndarray, later: np.ndarray
) -> int:
    """Returns the length of a shortest way in cells, -1 if there is none; `came` leads back from the goal.

    It is an A* search with the Manhattan distance, in which a step costs nothing if it leads nearer to the goal, else
    one detour.

    Args:
      walls: `[N, N]` bool, with a closed border.
      cost: `[N * N]` int32, where the search keeps the detours to each cell.
      came: `[N * N]` int32, where it keeps the cell before each.
      now: `[4 * N * N]` int32, for the cells to search by this number of detours.
      later: likewise, by one more.
    """
    size, flat = len(walls), walls.ravel()
    goal_row, goal_column = goal // size, goal % size
    cost[:] = 2**30
    cost[start], came[start], now[0] = 0, start, start
    detours, num_now, num_later = 0, 1, 0
    while True:
        if num_now == 0:
            if num_later == 0:
                return -1
            now, later, num_now, num_later = later, now, num_later, 0
            detours += 1
        num_now -= 1
        cell = now[num_now]
        if cost[cell] != detours:
            continue  # it was reached with fewer
        row, column = cell // size, cell % size
        if cell == goal:
            return abs(start // size - goal_row) + abs(start % size - goal_column) + 2 * detours
        for step in (1, size, -1, -size):
            other = cell + step
            if flat[other]:
                continue
            if step == 1:
                nearer = column < goal_column
            elif step == -1:
                nearer = column > goal_column
            elif step == size:
                nearer = row < goal_row
            else:
                nearer = row > goal_row
            if nearer and detours < cost[other]:
                cost[other], came[other], now[num_now] = detours, cell, other
                num_now += 1
            elif not nearer and detours + 1 < cost[other]:
                cost[other], came[other], later[num_later] = detours + 1, cell, other
                num_later += 1


@compiled
def shortest_ways(walls: np.ndarray, pairs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns the shortest ways that a robot plans on a map.

    Args:
      walls: `[N, N]` bool, of the map.
      pairs: `[P, 2]` int, start and goal, which are joined.

    Returns:
      cells: `[W]` int, of one way after the other, each from its goal to its start.
      lengths: `[P]` int, the number of steps of each way, one less than its cells.
    """
    cost, came = np.empty(walls.size, np.int32), np.empty(walls.size, np.int32)
    now, later = np.empty(4 * walls.size, np.int32), np.empty(4 * walls.size, np.int32)
    cells = [0]  # numba takes the type from an element
    lengths = np.empty(len(pairs), np.int64)
    for number in range(len(pairs)):
        start, cell = pairs[number]
        lengths[number] = plan(walls, start, cell, cost, came, now, later)
        while cell != start:
            cells.append(cell)
            cell = came[cell]
        cells.append(cell)
    return np.array(cells[1:]), lengths


def follow(
    walls: np.ndarray, shown: np.ndarray, pairs: np.ndarray, sight: float, most: float
) -> tuple[np.ndarray, np.ndarray]:
    """Returns how far a robot drives that follows its map.

    Where the map shows no way, the robot forgets the walls on it that it has not seen.

    Args:
      walls: `[N, N]` bool, of the building, with a closed border.
      shown: `[N, N]` bool, of the robot's map, with a closed border.
      pairs: `[P, 2]` int, start and goal, which are free and joined in the building.
      sight: cells, how far the robot sees; at least 1.
      most: times the shortest way, where the robot ends its drive if it can't reach the goal within that.

    Returns:
      driven: `[P]` int, cells; where the drive has ended, what it would have been at least.
      shortest: `[P]` int, cells of a shortest way in the building.
    """
    walls, shown = (np.array(grid, order="C") for grid in (walls, shown))  # for kernels, of one type in all calls
    offsets, after = sight_lines(sight)
    window = np.ones((2 * offsets.max() + 1,) * 2, dtype=np.uint8)
    can_be_wrong = cv2.dilate((walls != shown).astype(np.uint8), window).astype(bool).ravel()
    return _follow(walls, shown, pairs, offsets @ (len(walls), 1), after, can_be_wrong, most)


@compiled
def _follow(
    walls: np.ndarray,
    shown: np.ndarray,
    pairs: np.ndarray,
    steps: np.ndarray,
    after: np.ndarray,
    can_be_wrong: np.ndarray,
    most: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Does the work of `follow`.

    `steps` (`[K]` int) lead from a cell to those of `sight_lines`, to which `after` belongs. Only from the cells of
    `can_be_wrong` (`[N * N]` bool) may the map look wrong.
    """
    size = len(walls)
    true, cost, came = walls.ravel(), np.empty(walls.size, np.int32), np.empty(walls.size, np.int32)
    now, later = np.empty(4 * walls.size, np.int32), np.empty(4 * walls.size, np.int32)
    ahead = np.empty(walls.size, np.int32)  # of each cell of the way, the next one
    on_way, is_seen = np.empty(walls.size, np.int32), np.empty(walls.size, np.bool_)
    driven, shortest = np.zeros(len(pairs), np.int64), np.empty(len(pairs), np.int64)
    track = np.empty(int(most * walls.size) + 2, np.int64)  # the cells of a drive
    for number in range(len(pairs)):
        here, goal = pairs[number]
        shortest[number] = plan(walls, here, goal, cost, came, now, later)
        limit = most * shortest[number]
        belief = shown.copy()
        belief_of = belief.ravel()
        is_seen[:], on_way[:] = False, 0
        num_plans, is_wrong, has_forgotten = 0, True, False
        while here != goal:
            # See, and correct the map.
            track[driven[number]] = here
            if has_forgotten or can_be_wrong[here]:
                is_wrong |= look(here, true, belief_of, is_seen, on_way, num_plans, steps, after)

            # Plan again if the way is blocked, or may not be the shortest any more.
            if is_wrong and plan(belief, here, goal, cost, came, now, later) < 0:
                for index in range(driven[number] + 1):
                    look(track[index], true, belief_of, is_seen, on_way, num_plans, steps, after)
                has_forgotten = True
                for cell in range(size, walls.size - size):
                    if not is_seen[cell] and 0 < cell % size < size - 1:
                        belief_of[cell] = False
                plan(belief, here, goal, cost, came, now, later)
            if is_wrong:
                num_plans, is_wrong, cell = num_plans + 1, False, goal
                while cell != here:
                    on_way[cell], ahead[came[cell]] = num_plans, cell
                    cell = came[cell]

            # Drive on.
            here = ahead[here]
            driven[number] += 1
            left = abs(here // size - goal // size) + abs(here % size - goal % size)
            if driven[number] + left > limit:
                driven[number] += left
                break
    return driven, shortest


@compiled
def look(
    here: int,
    true: np.ndarray,
    belief: np.ndarray,
    is_seen: np.ndarray,
    on_way: np.ndarray,
    way: int,
    steps: np.ndarray,
    after: np.ndarray,
) -> bool:
    """Corrects a map by what is in sight; returns whether the way is blocked or there may be a shorter one.

    `belief` and `is_seen` are changed. `on_way` has the number of the last way of each cell, `way` that of the way that
    the robot drives. All are lists of the cells.
    """
    is_wrong, index = False, 0
    while index < len(steps):
        cell = here + steps[index]
        is_seen[cell] = True
        if belief[cell] != true[cell]:
            belief[cell] = true[cell]
            is_wrong |= not true[cell] or on_way[cell] == way
        index = after[index] if true[cell] else index + 1
    return is_wrong
