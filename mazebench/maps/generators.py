"""Random mazes by style name: `dfs`, `rooms`, `obstacles`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import ndimage

from mazebench.errors import InputError, unknown
from mazebench.maps.grids import largest_area
from mazebench.maps.maze import MAX_SIZE, MIN_SIZE, Cell, Maze

# Share of the walls between two corridors that are opened. With it, over 90 % of 13 x 13 mazes have 3 to 6 landmarks at
# distance 5 from corner to corner, as in the paper (docs/maps.md has the distribution over 1,000 mazes).
DFS_OPENINGS = 0.10
_OBSTACLE_DENSITY = 0.25  # share of the inner cells that become walls
# Of the labmaze library's rooms, in cells. The sides are odd, so that walls between rooms lie between lattice cells.
_ROOM_SHAPES = ((3, 3), (3, 5), (5, 3))
_SMALLEST_FOR_ALL_SHAPES = 11
# Share of the doors that are opened though they are not needed. With it, mazes have as many walls as those of labmaze.
_EXTRA_DOORS = 0.15


def generate(style: str, size: int, rng: np.random.Generator, name: str | None = None) -> Maze:
    """Returns a random maze of `size` x `size` cells.

    Raises:
      InputError: if the style is unknown or can't make mazes of this size.
    """
    if style not in STYLES:
        raise unknown("style", style, STYLES)
    if not (isinstance(size, int | np.integer) and MIN_SIZE <= size <= MAX_SIZE):
        raise InputError(f"expected a size of {MIN_SIZE} to {MAX_SIZE} cells, found {size!r}")
    if not isinstance(rng, np.random.Generator):
        raise InputError(f"expected rng as a numpy.random.Generator, found {type(rng).__name__}")
    return Maze(STYLES[style](size, rng), name or f"{style}-{size}")


def dfs_walls(size: int, rng: np.random.Generator, openings: float = DFS_OPENINGS) -> np.ndarray:
    """Returns the walls of a maze of corridors: `[size, size]` bool.

    Randomised depth-first search on the cells with odd row and column joins them to a tree. Then each wall between two
    of them is opened with probability `openings`.
    """
    _require_odd("dfs", size)
    walls = np.ones((size, size), dtype=bool)
    row, column = 2 * rng.integers(size // 2, size=2) + 1
    _carve_corridors(walls, (row, column), rng)
    return walls & ~(_between_lattice_cells(walls) & (rng.random(walls.shape) < openings))


def _carve_corridors(walls: np.ndarray, start: Cell, rng: np.random.Generator) -> None:
    """Joins the walled cells of the odd lattice that can be reached from `start` over others to a tree, in place."""
    walls[start] = False
    stack = [start]
    while stack:
        row, column = stack[-1]
        closed = [
            (row + down, column + right)
            for down, right in ((-2, 0), (2, 0), (0, -2), (0, 2))
            if 0 < row + down < len(walls) and 0 < column + right < len(walls) and walls[row + down, column + right]
        ]
        if not closed:
            stack.pop()
            continue
        cell = closed[rng.integers(len(closed))]
        walls[cell] = walls[(row + cell[0]) // 2, (column + cell[1]) // 2] = False
        stack.append(cell)


def _between_lattice_cells(walls: np.ndarray) -> np.ndarray:
    """Returns the walls between two neighbouring cells of the odd lattice."""
    between = np.zeros_like(walls)
    between[1:-1:2, 2:-1:2] = between[2:-1:2, 1:-1:2] = True
    return between & walls


def rooms_walls(size: int, rng: np.random.Generator) -> np.ndarray:
    """Returns the walls of rooms joined by corridors without dead ends: `[size, size]` bool.

    Randomised depth-first search fills what the rooms leave of the odd lattice with corridors. Doors join rooms and
    corridors, and dead ends are closed.
    """
    _require_odd("rooms", size)
    walls = np.ones((size, size), dtype=bool)
    _carve_rooms(walls, max(1, (size // 6) ** 2), rng)
    for row, column in np.argwhere(walls[1::2, 1::2]) * 2 + 1:
        if walls[row, column]:
            _carve_corridors(walls, (row, column), rng)
    _open_doors(walls, rng)
    return _without_dead_ends(walls)


def _carve_rooms(walls: np.ndarray, most: int, rng: np.random.Generator) -> None:
    """Carves up to `most` rooms that do not touch into `walls`, in place: at least one, at places in random order."""
    corners = rng.permutation(np.argwhere(walls[1:-3:2, 1:-3:2])) * 2 + 1
    sides = rng.choice(_ROOM_SHAPES if len(walls) >= _SMALLEST_FOR_ALL_SHAPES else _ROOM_SHAPES[:1], size=len(corners))
    for (top, left), (bottom, right) in zip(corners, corners + sides, strict=True):
        if most and max(bottom, right) < len(walls) and walls[top:bottom, left:right].all():
            walls[top:bottom, left:right] = False
            most -= 1


def _open_doors(walls: np.ndarray, rng: np.random.Generator) -> None:
    """Opens the walls of a random spanning tree of the regions of free cells, and some more, in place."""
    regions, num_regions = ndimage.label(~walls)
    joined = np.arange(num_regions + 1)  # the number of the group of regions to which each region belongs
    for row, column in rng.permutation(np.argwhere(_between_lattice_cells(walls))):
        down, right = (1, 0) if row % 2 == 0 else (0, 1)  # to one of the regions that the door joins
        first = joined[regions[row - down, column - right]]
        second = joined[regions[row + down, column + right]]
        if first != second or rng.random() < _EXTRA_DOORS:
            walls[row, column] = False
            joined[joined == second] = first


def _without_dead_ends(walls: np.ndarray) -> np.ndarray:
    """Returns `walls` without free cells that have fewer than two free neighbours."""
    while True:
        free = ~walls
        num_ways = ndimage.convolve(free.astype(int), [[0, 1, 0], [1, 0, 1], [0, 1, 0]], mode="constant")
        dead = free & (num_ways < 2)
        if not dead.any():
            return walls
        walls = walls | dead


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
