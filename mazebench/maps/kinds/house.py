"""Houses: rooms that are split off each other, with walls and doors at any cell."""

from __future__ import annotations

import numpy as np

from mazebench.maps.kinds.floor_plan import open_doors, split_rooms
from mazebench.maps.kinds.kind import Kind

_LEAST_SIDE = 3  # of a room, in cells
_EXTRA_DOORS = 0.05


def house_walls(size: int, rng: np.random.Generator) -> np.ndarray:
    """Returns the walls of a house: `[size, size]` bool.

    The house is split into two rooms by a wall at a random place, and so is each room that is large enough.
    """
    walls = np.ones((size, size), dtype=bool)
    walls[1:-1, 1:-1] = False
    split_rooms(walls, (1, 1, size - 1, size - 1), _LEAST_SIDE, rng)
    open_doors(walls, np.zeros(walls.shape), _EXTRA_DOORS, rng)
    return walls


HOUSE = Kind("rooms that are split off each other", house_walls)
