"""Hospitals: a grid of corridors with departments in its blocks."""

from __future__ import annotations

import numpy as np
import scipy

from mazebench.maps.kinds.floor_plan import cut, open_doors, split_rooms
from mazebench.maps.kinds.kind import Kind

_BLOCK = 10  # cells across, with a corridor of two cells
_LEAST_BLOCK = 3
_LEAST_SIDE = 2  # of a room, in cells
_EXTRA_DOORS = 0.03


def hospital_walls(size: int, rng: np.random.Generator) -> np.ndarray:
    """Returns the walls of a hospital: `[size, size]` bool.

    Corridors cross in a grid, with a fire door between two crossings and at each end. Each block between them is a
    department: its rooms are joined by doors, and one of them has a door to a corridor.
    """
    walls = np.ones((size, size), dtype=bool)
    corridors, fire_walls = np.ones_like(walls), np.zeros_like(walls)
    corridors[[0, -1]] = corridors[:, [0, -1]] = False
    gaps = [4] * max(1, (size - 1) // _BLOCK - 1)
    rows, columns = (cut(1, size - 1, gaps, _LEAST_BLOCK, rng) for _ in range(2))
    first, last = 1 + _LEAST_SIDE, size - 1 - _LEAST_SIDE  # fire walls leave as much of a corridor's end
    for row, (top, bottom) in enumerate(rows, 1):
        for column, (left, right) in enumerate(columns, 1):
            walls[top:bottom, left:right] = False
            corridors[top - 1 : bottom + 1, left - 1 : right + 1] = False
            split_rooms(walls, (top, left, bottom, right), _LEAST_SIDE, rng)
            if column < len(columns):
                fire_walls[rng.integers(max(top, first), min(bottom, last)), right + 1 : right + 3] = True
            if row < len(rows):
                fire_walls[bottom + 1 : bottom + 3, rng.integers(max(left, first), min(right, last))] = True
    walls = walls & ~corridors | fire_walls
    open_doors(walls, scipy.ndimage.binary_dilation(corridors) & ~corridors, _EXTRA_DOORS, rng)
    return walls


HOSPITAL = Kind("a grid of corridors with departments between them", hospital_walls)
