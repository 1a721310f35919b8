"""Rooms joined by corridors without dead ends, as those of the labmaze library."""

from __future__ import annotations

import numpy as np
import scipy

from mazebench.maps.kinds.dfs import between_lattice_cells, carve_corridors
from mazebench.maps.kinds.kind import Kind, lattice_door_slots

# Of the labmaze library's rooms, in cells. The sides are odd, so that walls between rooms lie between lattice cells.
_ROOM_SHAPES = ((3, 3), (3, 5), (5, 3))
_SMALLEST_FOR_ALL_SHAPES = 11
# Share of the doors that are opened though they are not needed. With it, mazes have as many walls as those of labmaze.
_EXTRA_DOORS = 0.15


def rooms_walls(size: int, rng: np.random.Generator) -> np.ndarray:
    """Returns the walls of rooms joined by corridors without dead ends: `[size, size]` bool.

    Randomised depth-first search fills what the rooms leave of the odd lattice with corridors. Doors join rooms and
    corridors, and dead ends are closed.
    """
    walls = np.ones((size, size), dtype=bool)
    _carve_rooms(walls, max(1, (size // 6) ** 2), rng)
    for row, column in (np.argwhere(walls[1::2, 1::2]) * 2 + 1).tolist():
        if walls[row, column]:
            carve_corridors(walls, (row, column), rng)
    _open_doors(walls, rng)
    return _without_dead_ends(walls)


def _carve_rooms(walls: np.ndarray, most: int, rng: np.random.Generator) -> None:
    """Carves up to `most` rooms that do not touch into `walls`, in place: at least one, at places in random order."""
    corners = rng.permutation(np.argwhere(walls[1:-3:2, 1:-3:2])) * 2 + 1
    sides = rng.choice(_ROOM_SHAPES if len(walls) >= _SMALLEST_FOR_ALL_SHAPES else _ROOM_SHAPES[:1], size=len(corners))
    for (top, left), (bottom, right) in zip(corners.tolist(), (corners + sides).tolist(), strict=True):
        if most and max(bottom, right) < len(walls) and walls[top:bottom, left:right].all():
            walls[top:bottom, left:right] = False
            most -= 1


def _open_doors(walls: np.ndarray, rng: np.random.Generator) -> None:
    """Opens the walls of a random spanning tree of the regions of free cells, and some more, in place."""
    labels, num_regions = scipy.ndimage.label(~walls)
    regions = labels.tolist()
    joined = list(range(num_regions + 1))  # the number of the group of regions to which each region belongs
    for row, column in rng.permutation(np.argwhere(between_lattice_cells(walls))).tolist():
        down, right = (1, 0) if row % 2 == 0 else (0, 1)  # to one of the regions that the door joins
        first = joined[regions[row - down][column - right]]
        second = joined[regions[row + down][column + right]]
        if first != second or rng.random() < _EXTRA_DOORS:
            walls[row, column] = False
            joined = [first if group == second else group for group in joined]


def _without_dead_ends(walls: np.ndarray) -> np.ndarray:
    """Returns `walls` without free cells that have fewer than two free neighbours."""
    while True:
        ways = (~walls).astype(np.int8)
        num_ways = np.zeros_like(ways)
        num_ways[1:-1, 1:-1] = ways[:-2, 1:-1] + ways[2:, 1:-1] + ways[1:-1, :-2] + ways[1:-1, 2:]
        dead = ~walls & (num_ways < 2)
        if not dead.any():
            return walls
        walls = walls | dead


ROOMS = Kind("rooms and corridors between them", rooms_walls, lattice_door_slots, smallest=5, odd=True)
