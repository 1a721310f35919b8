"""Random mazes by style name: `dfs`, `rooms`, `obstacles`."""

from __future__ import annotations

from collections.abc import Callable

import labmaze
import numpy as np

from mazebench.errors import InputError, unknown
from mazebench.maps.grids import largest_area
from mazebench.maps.maze import MAX_SIZE, MIN_SIZE, Maze

# Share of the walls between two corridors that are opened. With it, over 90 % of 13 x 13 mazes have 3 to 6 landmarks at
# distance 5 from corner to corner, as in the paper (docs/maps.md has the distribution over 1,000 mazes).
DFS_OPENINGS = 0.10
_OBSTACLE_DENSITY = 0.25  # share of the inner cells that become walls
_LABMAZE_SEEDS = 2**31 - 1


def generate(style: str, size: int, rng: np.random.Generator, name: str | None = None) -> Maze:
    """Returns a random maze of `size` x `size` cells.

    Raises:
      InputError: if the style is unknown or can't make mazes of this size.
    """
    if style not in STYLES:
        raise unknown("style", style, STYLES)
    if not MIN_SIZE <= size <= MAX_SIZE:
        raise InputError(f"expected a size of {MIN_SIZE} to {MAX_SIZE} cells, found {size}")
    return Maze(STYLES[style](size, rng), name or f"{style}-{size}")


def dfs_walls(size: int, rng: np.random.Generator, openings: float = DFS_OPENINGS) -> np.ndarray:
    """Returns the walls of a maze of corridors: `[size, size]` bool.

    Randomised depth-first search on the cells with odd row and column joins them to a tree. Then each wall between two
    of them is opened with probability `openings`.
    """
    _require_odd("dfs", size)
    walls = np.ones((size, size), dtype=bool)
    start = tuple(2 * rng.integers(size // 2, size=2) + 1)
    walls[start] = False
    stack = [start]
    while stack:
        row, column = stack[-1]
        closed = [
            (row + down, column + right)
            for down, right in ((-2, 0), (2, 0), (0, -2), (0, 2))
            if 0 < row + down < size and 0 < column + right < size and walls[row + down, column + right]
        ]
        if not closed:
            stack.pop()
            continue
        cell = closed[rng.integers(len(closed))]
        walls[cell] = walls[(row + cell[0]) // 2, (column + cell[1]) // 2] = False
        stack.append(cell)
    return walls & ~_openings(walls, openings, rng)


def _openings(walls: np.ndarray, share: float, rng: np.random.Generator) -> np.ndarray:
    """Returns the walls between two cells of the odd lattice to open, each drawn with probability `share`."""
    candidate = np.zeros_like(walls)
    candidate[1:-1:2, 2:-1:2] = candidate[2:-1:2, 1:-1:2] = True
    return candidate & walls & (rng.random(walls.shape) < share)


def rooms_walls(size: int, rng: np.random.Generator) -> np.ndarray:
    """Returns the walls of rooms joined by corridors, made by the labmaze library: `[size, size]` bool.

    Free cells that can't be reached become walls.
    """
    _require_odd("rooms", size)
    text = labmaze.RandomMaze(
        height=size,
        width=size,
        max_rooms=max(1, (size // 6) ** 2),
        room_min_size=3,
        room_max_size=5 if size >= 11 else 3,
        extra_connection_probability=0.1,
        random_seed=int(rng.integers(_LABMAZE_SEEDS)),
    ).entity_layer
    return largest_area(
        np.array([[character == "*" for character in line] for line in str(text).splitlines()], dtype=bool)
    )


def obstacles_walls(size: int, rng: np.random.Generator) -> np.ndarray:
    """Returns the walls of an open field with single cells as walls: `[size, size]` bool.

    Free cells that can't be reached become walls.
    """
    walls = np.ones((size, size), dtype=bool)
    walls[1:-1, 1:-1] = rng.random((size - 2, size - 2)) < _OBSTACLE_DENSITY
    walls[tuple(rng.integers(1, size - 1, size=2))] = False
    return largest_area(walls)


STYLES: dict[str, Callable[[int, np.random.Generator], np.ndarray]] = {
    "dfs": dfs_walls,
    "rooms": rooms_walls,
    "obstacles": obstacles_walls,
}


def _require_odd(style: str, size: int) -> None:
    if size % 2 == 0:
        raise InputError(f"style {style!r} makes mazes of odd sizes only, found size {size}")
