"""Offices: wings with a corridor and rooms on both sides of it."""

from __future__ import annotations

import numpy as np
import scipy

from mazebench.maps.kinds.floor_plan import cut, open_doors
from mazebench.maps.kinds.kind import Kind

_WING = 10  # cells across, with a corridor of two cells and a row of rooms on both sides
_STRETCH = 10  # of a corridor between two fire doors, in cells on average
_LEAST_STRETCH = 4
_ROOM_WIDTH = 5  # on average, with a wall
_LEAST_SIDE = 2  # of a room, in cells
_EXTRA_DOORS = 0.03


def office_walls(size: int, rng: np.random.Generator) -> np.ndarray:
    """Returns the walls of an office: `[size, size]` bool.

    A corridor leads from each wing to the next one. The rooms of two wings stand back to back. Each room has a door to
    a corridor, and few have one to another room. Walls with a fire door divide the corridors.
    """
    walls = np.ones((size, size), dtype=bool)
    corridors, fire_walls = np.zeros((2, size, size), dtype=bool)
    num_wings = (size - 1) // _WING

    # Rows of rooms: between two of one wing are a corridor and its two walls, between those of two wings is a wall.
    rows = cut(1, size - 1, [4, 1] * (num_wings - 1) + [4], _LEAST_SIDE, rng)
    spans = [[(1, size - 1)] for _ in rows]  # of columns that rooms may fill
    for index in range(0, len(rows), 2):
        corridor = rows[index][1] + 1
        corridors[corridor : corridor + 2, 1:-1] = True
        stretches = cut(1, size - 1, [1] * ((size - 1) // _STRETCH - 1), _LEAST_STRETCH, rng)
        fire_walls[corridor : corridor + 2, [left - 1 for left, _ in stretches[1:]]] = True
        if index + 2 < len(rows):
            # The corridor to the next wing, at one end or anywhere.
            left = int(rng.choice((1, int(rng.integers(4, size - 5)), size - 3)))
            corridors[corridor : rows[index + 2][1] + 2, left : left + 2] = True
            fire_walls[rng.integers(corridor + 3, rows[index + 2][1]), left : left + 2] = True
            spans[index + 1] = spans[index + 2] = [(1, left - 1), (left + 3, size - 1)]

    for (top, bottom), row_spans in zip(rows, spans, strict=True):
        for start, end in row_spans:
            num_rooms = max(1, (end - start + 1) // _ROOM_WIDTH)
            for left, right in cut(start, end, [1] * (num_rooms - 1), _LEAST_SIDE, rng) if start < end else ():
                walls[top:bottom, left:right] = False
    walls = walls & ~corridors | fire_walls
    open_doors(walls, ~scipy.ndimage.binary_dilation(corridors), _EXTRA_DOORS, rng)
    return np.rot90(walls, int(rng.integers(4))).copy()


OFFICE = Kind("wings with a corridor and rooms on both sides", office_walls)
