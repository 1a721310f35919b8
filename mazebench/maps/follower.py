"""A robot on the grid that believes its map, and what it drives in the building.

It goes from cell to cell by a shortest 4-connected way on its map, sees the cells around it, corrects the map and plans
again where the map was wrong.

`P` is the number of pairs of a start and a goal, `K` of cells in sight and `L` of cells on a way. Cells are numbers,
row * N + column.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np

from mazebench.kernels import compiled

_TOLERANCE = 1e-6  # cells
_LONG = 2000  # cells, after which a search asks whether there is a way


class Drives(NamedTuple):
    """The drives of a robot that follows its map."""

    cells: np.ndarray  # int, the cells of one drive after the other, each with its start and its end
    driven: np.ndarray  # [P] int, cells; where the drive has ended, what it would have been at least
    shortest: np.ndarray  # [P] int, cells of a shortest way in the building
    # [P, 4] int, first and last row and column of what was looked at; changes elsewhere change nothing of the drive
    boxes: np.ndarray


def follow(walls: np.ndarray, shown: np.ndarray, pairs: np.ndarray, sight: float, most: float) -> Drives:
    """Returns how far a robot drives that follows its map, and the shortest ways.

    Where the map shows no way, the robot forgets the walls on it that it has not seen.

    Args:
      walls: `[N, N]` bool, of the building, with a closed border.
      shown: `[N, N]` bool, of the robot's map.
      pairs: `[P, 2]` int, start and goal, which are free and joined in the building.
      sight: cells, how far the robot sees; at least 1.
      most: times the shortest way, where the robot ends its drive if it can't reach the goal within that.
    """
    offsets, before = sight_lines(sight)
    lines = np.stack([offsets @ (len(walls), 1), before], axis=1)
    window = np.ones((2 * offsets.max() + 1,) * 2)
    shown = np.pad(shown[1:-1, 1:-1], 1, constant_values=True)
    can_be_wrong = cv2.dilate((walls != shown).astype(np.uint8), window).astype(bool).ravel()
    cells, driven, shortest, boxes = _follow(np.array(walls, order="C"), shown, can_be_wrong, pairs, lines, most)
    return Drives(cells, driven, shortest, boxes + offsets.max() * np.array([-1, 1, -1, 1]))


def sight_lines(reach: float) -> tuple[np.ndarray, np.ndarray]:
    """Returns the cells that are at most `reach` cells away, and the indices of those before them on lines of sight.

    The cells are rows and columns from the robot's cell (`[K, 2]` int), in an order in which those before come first.
    """
    longest = math.floor(reach + _TOLERANCE)
    offsets = np.argwhere(np.ones((2 * longest + 1,) * 2)) - longest
    offsets = offsets[(offsets**2).sum(axis=1) <= (reach + _TOLERANCE) ** 2]
    offsets = offsets[np.argsort(abs(offsets).max(axis=1), kind="stable")]

    # One step back along the longer axis, and to the nearest cell of the line along the other one.
    steps = np.maximum(abs(offsets).max(axis=1, keepdims=True), 1)
    before = np.rint(offsets * (steps - 1) / steps).astype(int)
    index = np.zeros((2 * longest + 1,) * 2, dtype=int)  # by offset, of which negative ones count from the end
    index[tuple(offsets.T)] = np.arange(len(offsets))
    return offsets, index[tuple(before.T)]


@compiled
def _follow(
    walls: np.ndarray, shown: np.ndarray, can_be_wrong: np.ndarray, pairs: np.ndarray, lines: np.ndarray, most: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Does the work of `follow`, with boxes of the cells that its searches have reached.

    Only from the cells of `can_be_wrong` (`[N * N]` bool) may the map look wrong. `lines` (`[K, 2]` int) are the steps
    to the cells of `sight_lines`, and the indices of those before.
    """
    size, true = len(walls), walls.ravel()
    driven, shortest = np.empty(len(pairs), np.int64), np.empty(len(pairs), np.int64)
    is_clear = np.ones(len(lines), np.bool_)
    cells = [0]  # numba takes the type from an element
    # One belief and one set of tables for all searches, of which each puts back what it has changed: the time of a
    # search is that of the cells that it reaches, whatever the size of the building.
    belief, altered = shown.copy(), [0]
    believed, told = belief.ravel(), shown.ravel()
    costs = np.full(walls.size, 2**30, np.int32)
    is_flooded = np.zeros(walls.size, np.bool_)
    tables = np.empty((5, 4 * walls.size), np.int32)
    boxes = np.empty((len(pairs), 4), np.int64)
    boxes[:, ::2], boxes[:, 1::2] = size, 0
    for number in range(len(pairs)):
        here, goal = pairs[number]
        way = _shortest_way(walls, here, goal, costs, is_flooded, tables, boxes[number])
        driven[number] = shortest[number] = len(way) - 1
        first = looked = len(cells)
        cells.append(here)
        has_map, is_wrong, at = True, True, 0
        while here != goal and driven[number] <= most * shortest[number]:
            # See what no wall hides, and correct the map: the way may be blocked, or there may be a shorter one.
            for visit in range(looked, len(cells)):
                if has_map and not can_be_wrong[cells[visit]]:
                    continue
                for index in range(len(lines)):
                    cell = cells[visit] + lines[index, 0]
                    is_clear[index] = is_clear[lines[index, 1]]
                    if is_clear[index]:
                        is_clear[index] = not true[cell]
                        if believed[cell] != true[cell]:
                            believed[cell] = true[cell]
                            altered.append(cell)
                            is_wrong |= is_clear[index] or cell in way
            looked = len(cells)

            # Plan again. Where there is no way, forget the map and look again from all cells of the drive.
            if is_wrong:
                way, at = _shortest_way(belief, here, goal, costs, is_flooded, tables, boxes[number]), 0
                is_wrong = len(way) == 0
                if is_wrong:
                    belief[1:-1, 1:-1] = False
                    looked, has_map = first, False
                    continue

            # Drive on.
            at += 1
            here = way[at]
            cells.append(here)
            left = abs(here // size - goal // size) + abs(here % size - goal % size)
            driven[number] = len(cells) - 1 - first + left

        # Believe the map again.
        if not has_map:
            belief[:] = shown
        for cell in altered:
            believed[cell] = told[cell]
        altered = altered[:1]
    return np.array(cells[1:]), driven, shortest, boxes


@compiled
def _shortest_way(
    walls: np.ndarray,
    start: int,
    goal: int,
    costs: np.ndarray,
    is_flooded: np.ndarray,
    tables: np.ndarray,
    box: np.ndarray,
) -> np.ndarray:
    """Returns the cells of a shortest way, none if there is no way: `[L]` int.

    It is an A* search with the Manhattan distance, in which a step costs nothing if it leads nearer to the goal, else
    one detour. A long search also floods the building from the goal, and ends where that does: where there is no way,
    the part around the goal is often small. `walls` is `[N, N]` bool, with a closed border.

    `costs` (`[N * N]` int32) are 2**30 before and after, `is_flooded` (`[N * N]` bool) is False, and `tables`
    (`[5, 4 * N * N]` int32) are for its work. It widens `box` (`[4]` int, first and last row and column) to hold the
    cells that it reaches.
    """
    size, flat = len(walls), walls.ravel()
    # Of each cell, the one before; cells by even and odd numbers of detours; cells that were reached.
    came, stacks, reached, flooded = tables[0], tables[1:3], tables[3], tables[4]
    counts, num_reached, num_searched, next_flooded, num_flooded = np.array([1, 0]), 1, 0, 0, 1
    costs[start], stacks[0, 0], reached[0] = 0, start, start
    flooded[0], is_flooded[goal] = goal, True
    cell, detours = start, 0
    while cell != goal:
        # A cell of the flood from the goal, unless it has come to the start.
        num_searched += 1
        if num_searched > _LONG and not is_flooded[start]:
            if next_flooded == num_flooded:
                break
            for step in (1, size, -1, -size):
                near = flooded[next_flooded] + step
                if not flat[near] and not is_flooded[near]:
                    flooded[num_flooded], is_flooded[near] = near, True
                    num_flooded += 1
            next_flooded += 1

        if counts[detours & 1] == 0:
            detours += 1
            if counts[detours & 1] == 0:
                break
        counts[detours & 1] -= 1
        cell = stacks[detours & 1, counts[detours & 1]]
        if costs[cell] != detours:
            continue  # it was reached with fewer
        down, right = goal // size - cell // size, goal % size - cell % size
        is_nearer = right > 0, down > 0, right < 0, down < 0
        for index, step in enumerate((1, size, -1, -size)):
            near, needed = cell + step, detours + (not is_nearer[index])
            if not flat[near] and needed < costs[near]:
                costs[near], came[near] = needed, cell
                stacks[needed & 1, counts[needed & 1]] = near
                counts[needed & 1] += 1
                reached[num_reached] = near
                num_reached += 1
    for index in range(num_reached + num_flooded):
        looked_at = reached[index] if index < num_reached else flooded[index - num_reached]
        costs[looked_at], is_flooded[looked_at] = 2**30, False
        row, column = looked_at // size, looked_at % size
        box[0], box[1] = min(box[0], row), max(box[1], row)
        box[2], box[3] = min(box[2], column), max(box[3], column)
    if cell != goal:
        return np.empty(0, np.int64)

    way = [goal]
    while way[-1] != start:
        way.append(came[way[-1]])
    return np.array(way[::-1])
