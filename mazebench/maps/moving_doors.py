"""The doors of a building that move while one drives, and the mazes that stand when some of them have moved.

`D` is the number of doors. A door is a box of cells. Most are free in the maze and closed when they have moved; others
are wall in it and open then. A set of moved doors is a number whose bit `d` says that door `d` has moved.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from mazebench.maps.covering import Rectangle, cover
from mazebench.maps.doors import Passage, door_slots
from mazebench.maps.drawn import FreshMazes, Mazes
from mazebench.maps.kinds import KINDS
from mazebench.maps.maze import Maze

# Of a building, open and walled, so that a maze and its moved doors are one number of 63 bits, also of 2**31 mazes.
MOST_OPEN, MOST_WALLED = 26, 6
_NUM_KEPT = 1024  # mazes with moved doors


def moving_doors(maze: Maze) -> tuple[Passage, ...]:
    """Returns the doors of a maze that can move, at most `MOST_OPEN` and `MOST_WALLED`.

    They are the door slots of its kind, or else passages. Where there are more, those come first that leave the maze in
    one piece when they close, and a hash of the walls chooses. No two touch.
    """
    return _moving_doors(maze, maze.kind)


@functools.lru_cache(maxsize=256)
def _moving_doors(maze: Maze, kind: str) -> tuple[Passage, ...]:
    if kind in KINDS and len(slots := door_slots(maze)):
        doors = [
            Passage(row, column, row + 1, column + 1, not maze.walls[row, column]) for row, column in slots.tolist()
        ]
    else:
        from mazebench.maps.passages import find_passages  # which needs numba

        doors = list(find_passages(maze.walls, maze.cell_size))

    # In a random order; of the open ones, those that leave the maze in one piece come first.
    rng = np.random.default_rng(list(hashlib.sha256(np.packbits(maze.walls).tobytes()).digest()))
    doors = [doors[index] for index in rng.permutation(len(doors))]
    doors.sort(key=lambda door: 2 - is_joined(moved_walls(maze.walls, [door])) if door.is_open else 3)
    chosen: list[Passage] = []
    left = {True: MOST_OPEN, False: MOST_WALLED}
    taken = np.zeros(maze.walls.shape, dtype=bool)
    for door in doors:
        if left[door.is_open] and not taken[door.top - 1 : door.bottom + 1, door.left - 1 : door.right + 1].any():
            taken[door.cells()] = True
            left[door.is_open] -= 1
            chosen.append(door)
    return tuple(chosen)


def moved_walls(walls: np.ndarray, doors: Iterable[Passage]) -> np.ndarray:
    """Returns walls `[N, N]` bool in which some doors have moved."""
    moved = walls.copy()
    for door in doors:
        moved[door.cells()] = door.is_open
    return moved


def is_joined(walls: np.ndarray) -> bool:
    """Returns whether the free cells of `walls` (`[N, N]` bool, with a closed border) are one area."""
    from mazebench.maps.search import search  # which needs numba

    free = np.flatnonzero(~walls)
    return len(free) > 0 and len(search(walls, free[0], -1, walls.size)[0]) == len(free)


@dataclasses.dataclass(frozen=True, eq=False)
class MovedMaze(Maze):
    """A maze some of whose doors have moved. Its free cells need not be connected, so it has no distances."""

    built: Maze | None = None  # before they moved
    moved: tuple[Passage, ...] = ()

    def __post_init__(self) -> None:
        """Trusts its walls."""

    def __reduce__(self) -> tuple[Any, ...]:
        return MovedMaze, (self.walls, self.name, self.cell_size, self.kind, self.built, self.moved)

    @property
    def as_built(self) -> Maze:
        """The maze before any door moved."""
        assert self.built is not None
        return self.built

    @property
    def only_closed(self) -> bool:
        """True if the walls are those of the maze and its closed doors."""
        return all(door.is_open for door in self.moved)

    @functools.cached_property
    def boxes(self) -> list[Rectangle]:
        """Those of the maze and its closed doors, in the order of their first cells; of opened doors, others."""
        if not self.only_closed:
            return cover(self.walls)
        return sorted([*self.as_built.boxes, *(Rectangle(*door[:4]) for door in self.moved)])

    @classmethod
    def of(cls, maze: Maze, moved: int) -> MovedMaze:
        """Returns a maze in which a set of its doors has moved."""
        doors = tuple(door for number, door in enumerate(moving_doors(maze)) if moved >> number & 1)
        return cls(moved_walls(maze.walls, doors), maze.name, maze.cell_size, maze.kind, maze, doors)


@dataclasses.dataclass(frozen=True)
class ChangingMazes:
    """Some mazes, and behind them each maze with each set of its doors moved.

    Number `maze + len(mazes) * moved` is maze number `maze` in which the set `moved` has moved.
    """

    mazes: Mazes
    _kept: dict[int, MovedMaze] = dataclasses.field(default_factory=dict, init=False, repr=False, compare=False)

    def __len__(self) -> int:
        return len(self.mazes)

    def __iter__(self) -> Iterator[Maze]:
        return (self.mazes[number] for number in range(len(self.mazes)))

    def __getitem__(self, number: int) -> Maze:
        if number < len(self.mazes):
            return self.mazes[number]
        if (kept := self._kept.get(number)) is None:
            moved, maze = divmod(int(number), len(self.mazes))
            if len(self._kept) >= _NUM_KEPT:
                self._kept.clear()
            kept = self._kept[number] = MovedMaze.of(self.mazes[maze], moved)
        return kept

    @functools.cached_property
    def cell_size(self) -> float:
        """The width of the cells in metres."""
        return self.mazes[0].cell_size


StandingMazes = tuple[Maze, ...] | FreshMazes | ChangingMazes
