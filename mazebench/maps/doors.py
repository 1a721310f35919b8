"""Doors of a maze, and maps of it on which some of them have moved.

`D` is the number of door slots. A slot is a cell in a wall between two rooms that may be open or closed.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from mazebench.errors import InputError, unknown
from mazebench.maps.kinds import KINDS
from mazebench.maps.kinds.kind import door_slots as any_door_slots
from mazebench.maps.kinds.kind import rooms_beside
from mazebench.maps.maze import Cell, Maze

_MOST_DOORS = 4  # of a room, that are told apart: a corridor has many


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
    walls: np.ndarray, slots: np.ndarray, num_swaps: int, keep: Iterable[Cell], rng: np.random.Generator
) -> np.ndarray:
    """Returns the walls of a map on which doors have moved: `[N, N]` bool, connected like `walls`.

    A swap opens a closed door and closes an open one on a way around it, so that all rooms stay joined. No door moves
    twice, and doors that are opened do not touch. Doors are drawn by the odds, in `walls`, that a door is open between
    two rooms with as many other doors. So the map has about as many dead ends and crossings as the building, and tells
    little of what has moved.

    Args:
      walls: `[N, N]` bool, of the maze.
      slots: `[D, 2]` int, its door slots.
      num_swaps: how many doors are open in the maze but closed on the map; as many are the other way round.
      keep: cells that are free on the map, too.
      rng: draws the doors.

    Raises:
      InputError: if no such map was found.
    """
    doors = _Doors(walls, slots)
    kept = np.isin(slots @ (len(walls), 1), [row * len(walls) + column for row, column in keep])
    may_close, may_open = doors.is_open & ~kept, ~doors.is_open
    odds = doors.odds()
    for _ in range(num_swaps):
        odds_now = odds[doors.types()]
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
        may_open[np.abs(slots - slots[opened]).sum(axis=1) <= 1] = False  # it, and those that touch it
    moved = walls.copy()
    moved[tuple(slots.T)] = ~doors.is_open
    return moved


class _Doors:
    """The doors of a map, open or not, and the rooms that they join. `R` is the number of rooms and 1."""

    def __init__(self, walls: np.ndarray, slots: np.ndarray):
        self.is_open = ~walls[tuple(slots.T)]  # [D] bool
        self._rooms = np.sort(rooms_beside(walls, slots), axis=0)  # [2, D] int, from 1
        self._num_rooms = int(self._rooms.max(initial=0)) + 1
        _, self._pair = np.unique(self._rooms.T @ (self._num_rooms, 1), return_inverse=True)  # [D] int, pair of rooms
        self._ways: list[dict[int, int]] = [
            {} for _ in range(self._num_rooms)
        ]  # of a room: open doors, rooms behind them
        for door in np.flatnonzero(self.is_open).tolist():
            self._toggle_way(door)

    def types(self) -> np.ndarray:
        """Returns `[D]` int: the same number for doors whose rooms have as many other doors, also between them."""
        num_doors = np.bincount(self._rooms[:, self.is_open].ravel(), minlength=self._num_rooms)  # [R] int, open ones
        others = np.minimum(num_doors[self._rooms] - self.is_open, _MOST_DOORS)
        is_second = np.bincount(self._pair, self.is_open)[self._pair] > self.is_open
        return (np.sort(others, axis=0).T @ (_MOST_DOORS + 1, 1)) * 2 + is_second

    def odds(self) -> np.ndarray:
        """Returns the odds that a door is open, by type."""
        types, num_types = self.types(), 2 * (_MOST_DOORS + 1) ** 2
        num_open = np.bincount(types, self.is_open, num_types)
        num_closed = np.bincount(types, ~self.is_open, num_types)
        return (num_open + 0.5) / (num_closed + 0.5)  # a half each for types that are rare

    def way_around(self, door: int) -> list[int]:
        """Returns the open doors on a shortest way from one room of a closed door to the other."""
        start, goal = self._rooms[:, door].tolist()
        came_by = {start: (-1, start)}  # of each room that was seen: the door to it, and the room before
        queue = [start]
        for room in queue:
            if room == goal:
                break
            for way, behind in self._ways[room].items():
                if behind not in came_by:
                    came_by[behind] = (way, room)
                    queue.append(behind)
        doors = []
        room = goal
        while room != start:
            way, room = came_by[room]
            doors.append(way)
        return doors

    def swap(self, opened: int, closed: int) -> None:
        """Opens a closed door, and closes an open one."""
        self.is_open[opened], self.is_open[closed] = True, False
        self._toggle_way(opened)
        self._toggle_way(closed)

    def _toggle_way(self, door: int) -> None:
        for room, behind in (self._rooms[:, door].tolist(), self._rooms[::-1, door].tolist()):
            if self._ways[room].pop(door, None) is None:
                self._ways[room][door] = behind


def _draw(weights: np.ndarray, rng: np.random.Generator) -> int:
    """Returns an index of `weights`, each in proportion to its weight."""
    return int(np.searchsorted(np.cumsum(weights), rng.random() * weights.sum(), side="right"))
