"""Doors of a maze, and maps of it on which some of them have moved.

`D` is the number of door slots. A slot is a cell in a wall between two rooms that may be open or closed.
"""

from __future__ import annotations

import copy
import functools
import itertools
import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from mazebench.errors import InputError, unknown
from mazebench.maps.kinds import KINDS
from mazebench.maps.kinds.kind import door_slots as any_door_slots
from mazebench.maps.kinds.kind import rooms_beside
from mazebench.maps.maze import Cell, Maze

_MOST_DOORS = 4  # of a room, that are told apart: a corridor has many
_NUM_KEPT = 128  # mazes whose doors are kept; those of 31 x 31 cells take up to 100 kB
_MOST_CELLS_KEPT = 64 * 64  # of a maze whose doors are kept


class Passage(NamedTuple):
    """The cells of rows [top, bottom) and columns [left, right), all free (open) or all wall."""

    top: int
    left: int
    bottom: int
    right: int
    is_open: bool

    def cells(self) -> tuple[slice, slice]:
        """Returns the rows and columns."""
        return slice(self.top, self.bottom), slice(self.left, self.right)


def door_slots(maze: Maze) -> np.ndarray:
    """Returns the door slots of a maze, as its kind has them: `[D, 2]` int, in reading order.

    Raises:
      InputError: if its kind is unknown.
    """
    if maze.kind and maze.kind not in KINDS:
        raise unknown("kind", maze.kind, KINDS)
    return KINDS[maze.kind].door_slots(maze.walls) if maze.kind else any_door_slots(maze.walls)


def num_swappable(maze: Maze) -> int:
    """Returns how many doors of a maze may move at most: it has no more open ones, or no more closed ones."""
    is_closed = maze.walls[tuple(door_slots(maze).T)]
    return int(min(is_closed.sum(), (~is_closed).sum()))


def swap_doors(
    walls: np.ndarray, kind: str, num_swaps: int, keep: Iterable[Cell], rng: np.random.Generator
) -> np.ndarray:
    """Returns the walls of a map on which doors have moved: `[N, N]` bool, connected like `walls`.

    A swap opens a closed door and closes an open one on a way around it, so that all rooms stay joined. No door moves
    twice, and doors that are opened do not touch. Doors are drawn by the odds, in `walls`, that a door is open between
    two rooms with as many other doors. So the map has about as many dead ends and crossings as the building, and tells
    little of what has moved.

    Args:
      walls: `[N, N]` bool, of the maze.
      kind: of the maze.
      num_swaps: how many doors are open in the maze but closed on the map; as many are the other way round.
      keep: cells that are free on the map, too.
      rng: draws the doors.

    Raises:
      InputError: if no such map was found.
    """
    find_doors = _doors if walls.size <= _MOST_CELLS_KEPT else _doors.__wrapped__
    doors = find_doors(walls.tobytes(), kind).copy()
    cells = doors.slots @ (len(walls), 1)
    kept = (cells[:, None] == [row * len(walls) + column for row, column in keep]).any(axis=1)
    may_close, may_open = doors.is_open & ~kept, ~doors.is_open
    for _ in range(num_swaps):
        odds_now = doors.odds[doors.types()]
        weights = np.where(may_open, odds_now, 0.0)
        closable: list[int] = []
        while not closable:
            if not weights.any():
                raise InputError(f"found no map with {num_swaps} doors moved; give a maze that has more doors")
            opened = _draw(weights, rng)
            weights[opened] = 0.0
            closable = [door for door in doors.way_around(opened) if may_close[door]]
        closed = closable[_draw(1 / odds_now[closable], rng)]
        doors.swap(opened, closed)
        may_close[closed] = False
        gap = np.abs(cells - cells[opened])
        may_open[(gap <= 1) | (gap == len(walls))] = False  # it, and those that touch it
    moved = walls.copy()
    moved[tuple(doors.slots.T)] = ~doors.is_open
    return moved


@functools.lru_cache(maxsize=_NUM_KEPT)
def _doors(walls: bytes, kind: str) -> DoorGraph:
    size = math.isqrt(len(walls))
    maze = Maze(np.frombuffer(walls, dtype=bool).reshape(size, size), kind=kind)
    return DoorGraph(maze.walls, door_slots(maze))


class DoorGraph:
    """The doors of a map, open or not, and the rooms that they join. `R` is the number of rooms and 1."""

    def __init__(self, walls: np.ndarray, slots: np.ndarray):
        """Takes `walls` `[N, N]` bool and their door slots `[D, 2]` int."""
        self.slots = slots
        self.is_open = ~walls[tuple(self.slots.T)]  # [D] bool
        self._rooms = np.sort(rooms_beside(walls, self.slots), axis=0)  # [2, D] int, from 1
        num_rooms = int(self._rooms.max(initial=0)) + 1
        _, self._pair = np.unique(self._rooms.T @ (num_rooms, 1), return_inverse=True)  # [D] int, pair of rooms

        # The open doors: how many a room ([R] int) and a pair of rooms has, and those of a room, with the rooms behind.
        self._num_open = np.bincount(self._rooms[:, self.is_open].ravel(), minlength=num_rooms)
        self._num_between = np.bincount(self._pair[self.is_open], minlength=self._pair.max(initial=-1) + 1)
        self._ways: list[dict[int, int]] = [{} for _ in range(num_rooms)]
        for door in np.flatnonzero(self.is_open).tolist():
            for room, behind in itertools.permutations(self._rooms[:, door].tolist()):
                self._ways[room][door] = behind

        # The odds that a door is open, by type; a half each for types that are rare.
        types, num_types = self.types(), 2 * (_MOST_DOORS + 1) ** 2
        num_open, num_closed = (np.bincount(types, each, num_types) for each in (self.is_open, ~self.is_open))
        self.odds = (num_open + 0.5) / (num_closed + 0.5)

    def copy(self) -> DoorGraph:
        """Returns doors that may be swapped without a change of these."""
        copied = copy.copy(self)
        for name in ("is_open", "_num_open", "_num_between", "_ways"):
            setattr(copied, name, copy.copy(getattr(self, name)))
        return copied

    def types(self) -> np.ndarray:
        """Returns `[D]` int: the same number for doors whose rooms have as many other doors, also between them."""
        first, second = np.minimum(self._num_open[self._rooms] - self.is_open, _MOST_DOORS)
        is_second = self._num_between[self._pair] > self.is_open
        return (np.minimum(first, second) * (_MOST_DOORS + 1) + np.maximum(first, second)) * 2 + is_second

    def way_around(self, door: int) -> list[int]:
        """Returns the open doors on a shortest way from one room of a closed door to the other; none if none leads."""
        start, goal = self._rooms[:, door].tolist()
        came_by = {start: (-1, start)}  # of each room that was seen: the door to it, and the room before
        queue = [start]
        for room in queue:
            for way, behind in self._ways[room].items():
                if behind not in came_by:
                    came_by[behind] = (way, room)
                    queue.append(behind)
            if goal in came_by:
                break
        doors = []
        room = goal if goal in came_by else start
        while room != start:
            way, room = came_by[room]
            doors.append(way)
        return doors

    def swap(self, opened: int, closed: int) -> None:
        """Opens a closed door, and closes an open one."""
        for door, change in ((opened, 1), (closed, -1)):
            self.is_open[door] = change > 0
            self._num_between[self._pair[door]] += change
            for room, behind in itertools.permutations(self._rooms[:, door].tolist()):
                self._num_open[room] += change
                self._ways[room] = self._ways[room] | {door: behind}  # a new one: copies share the old one
                if change < 0:
                    del self._ways[room][door]


def _draw(weights: np.ndarray, rng: np.random.Generator) -> int:
    """Returns an index of `weights`, each in proportion to its weight."""
    return int(weights.cumsum().searchsorted(rng.random() * weights.sum(), side="right"))
