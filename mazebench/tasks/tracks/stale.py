"""The track `stale`: the map shows an earlier state of the building, in which other doors were open."""

from __future__ import annotations

import bisect
import dataclasses
import functools
import itertools
import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from mazebench.errors import InputError
from mazebench.maps.maze import Cell, Maze, path_through_walls
from mazebench.tasks.perturbations.base import ShownMap
from mazebench.tasks.tracks.base import Track

SWAPS = (3, 6, 12)  # by level

_MAX_TRIES = 10_000
# The weight of the doors that are open in the world is exp(a - b * swaps / rooms). With these numbers, most first tries
# have about as many swaps as are wanted, in mazes of 13 x 13 cells; the weight is adapted from try to try.
_LOG_WEIGHT = (4.8, 13.0)
_ADAPTATION = 1.1


class Stale(Track):
    """Shows a maze in which some doors are closed that are open in the world, and as many are open that are closed.

    A door is a cell between two rooms, which are the cells with odd row and column. A swap closes one open door and
    opens one closed door. Start and goal are free on the map, too.
    """

    help = "The map shows an earlier state of the building: doors have moved since."
    stream = 5
    levels = ("3 doors were closed since, and 3 others opened", "6 and 6 doors", "12 and 12 doors")

    def show(self, shown: ShownMap, level: float, ends: tuple[Cell, Cell], rng: np.random.Generator) -> ShownMap:
        return dataclasses.replace(shown, walls=move_doors(shown.walls, SWAPS[int(level) - 1], ends, rng))

    def check(self, maze: Maze, levels: Sequence[int]) -> None:
        swaps = SWAPS[max(levels) - 1]
        if not _has_corridors(maze.walls):
            raise InputError(
                f"{maze.name}: track 'stale' needs a maze of corridors, with an odd number of cells a side: rooms with "
                "odd row and column are free, cells with even row and column are walls"
            )
        movable = num_movable(maze.walls)
        if movable < swaps:
            raise InputError(f"{maze.name}: track 'stale' needs {swaps} doors that can move, found {movable}")

    def facts(self, maze: Maze, shown: ShownMap, ends: tuple[Cell, Cell]) -> dict[str, bool | str]:
        return {"blocked": is_blocked(maze.walls, shown.walls, ends)}


def is_blocked(walls: np.ndarray, shown: np.ndarray, ends: tuple[Cell, Cell]) -> bool:
    """Returns whether a shortest path on the shown map leads through a wall of the world; both `[N, N]` bool."""
    return bool(walls[tuple(np.transpose(path_through_walls(shown, *ends)))].any())


def num_movable(walls: np.ndarray) -> int:
    """Returns how many doors of a maze can be closed while others are opened; 0 if it is no maze of corridors."""
    if not _has_corridors(walls):
        return 0
    is_open = _is_open(walls)
    # Two more, because start and goal may be doors.
    return max(0, min(int((~is_open).sum()), int(is_open.sum()) - 2))


def move_doors(walls: np.ndarray, num_swaps: int, keep: Iterable[Cell], rng: np.random.Generator) -> np.ndarray:
    """Returns the walls of an earlier state of a maze of corridors: `[N, N]` bool, connected like `walls`.

    The earlier maze is made as the maze was: a randomised depth-first search joins the rooms, then more doors are
    opened. The search prefers doors that are open in the maze, so that it leads to a maze of the same style with few
    other doors. Random swaps would leave crossings and dead ends that a search does not make, by which they could be
    told from the map alone (`benchmarks/stale_classifier.py`).

    Args:
      walls: `[N, N]` bool, of the maze.
      num_swaps: how many doors are open in the maze but closed in the earlier one; as many are the other way round.
      keep: cells that are free in both.
      rng: draws the search and the openings.

    Raises:
      InputError: if no such maze was found.
    """
    doors, is_open = _doors(len(walls)), _is_open(walls)
    kept = [door for door, cell in enumerate(doors.cells.tolist()) if tuple(cell) in set(keep)]
    intercept, slope = _LOG_WEIGHT
    weight = math.exp(intercept - slope * num_swaps / len(doors.ways))
    for _ in range(_MAX_TRIES):
        earlier = _search(doors, is_open, weight, rng)

        # How many doors are still to be opened: of those that are closed in the maze, and of those that are open.
        num_new = num_swaps - int((earlier & ~is_open).sum())
        num_old = int(is_open.sum()) - int(earlier.sum()) - num_new
        new, old = np.flatnonzero(~is_open & ~earlier), np.flatnonzero(is_open & ~earlier)
        if 0 <= num_new <= len(new) and 0 <= num_old <= len(old):
            earlier[rng.choice(new, num_new, replace=False)] = True
            earlier[rng.choice(old, num_old, replace=False)] = True
            if earlier[kept].all():
                moved = walls.copy()
                moved[tuple(doors.cells.T)] = ~earlier
                return moved

        # The search had too many swaps, or too few.
        if num_new < 0:
            weight *= _ADAPTATION
        elif num_old < 0:
            weight *= 1 / _ADAPTATION
    raise InputError(f"found no maze with {num_swaps} doors moved; give a larger maze")


def _has_corridors(walls: np.ndarray) -> bool:
    return len(walls) % 2 == 1 and not walls[1::2, 1::2].any() and bool(walls[::2, ::2].all())


class _Doors(NamedTuple):
    """The doors of all mazes of corridors of one size."""

    cells: np.ndarray  # [D, 2] int
    ways: tuple[tuple[tuple[int, int], ...], ...]  # of each room: the doors it has, and the rooms behind them


@functools.cache
def _doors(size: int) -> _Doors:
    across = size // 2
    cells: list[Cell] = []
    ways: list[list[tuple[int, int]]] = [[] for _ in range(across * across)]
    for room in range(across * across):
        row, column = divmod(room, across)
        for down, right in ((0, 1), (1, 0)):
            if row + down < across and column + right < across:
                other = room + down * across + right
                ways[room].append((len(cells), other))
                ways[other].append((len(cells), room))
                cells.append((2 * row + 1 + down, 2 * column + 1 + right))
    return _Doors(np.array(cells), tuple(map(tuple, ways)))


def _is_open(walls: np.ndarray) -> np.ndarray:  # [D] bool
    return ~walls[tuple(_doors(len(walls)).cells.T)]


def _search(doors: _Doors, preferred: np.ndarray, weight: float, rng: np.random.Generator) -> np.ndarray:
    """Returns `[D]` bool: the doors through which a depth-first search first came to each room.

    From a room it goes on to one of those that it has not seen, through a preferred door (`[D]` bool) `weight` times as
    often as through another one.
    """
    weights = np.where(preferred, weight, 1.0).tolist()
    passed = np.zeros(len(weights), dtype=bool)
    draws = iter(rng.random(len(doors.ways) - 1).tolist())
    stack = [int(rng.integers(len(doors.ways)))]
    seen = set(stack)
    while stack:
        ways = [way for way in doors.ways[stack[-1]] if way[1] not in seen]
        if not ways:
            stack.pop()
            continue
        shares = list(itertools.accumulate(weights[door] for door, _ in ways))
        door, room = ways[bisect.bisect(shares, next(draws) * shares[-1], hi=len(ways) - 1)]
        passed[door] = True
        seen.add(room)
        stack.append(room)
    return passed
