"""Museums: enfilades, which are rooms one after the other."""

from __future__ import annotations

import numpy as np

from mazebench.maps.kinds.floor_plan import cut, open_doors
from mazebench.maps.kinds.kind import Kind

_ROOM_SIDE = 6  # on average, with a wall
_LEAST_SIDE = 2  # of a room, in cells
_IN_LINE = 0.5  # share of the enfilades whose doors are in line
_EXTRA_DOORS = 0.05


def museum_walls(size: int, rng: np.random.Generator) -> np.ndarray:
    """Returns the walls of a museum: `[size, size]` bool.

    The rooms of an enfilade are joined by doors in line or anywhere. A door leads from each enfilade to the next one.
    """
    walls = np.ones((size, size), dtype=bool)
    cost = np.zeros(walls.shape)
    gaps = [1] * ((size - 1) // _ROOM_SIDE - 1)
    for top, bottom in cut(1, size - 1, gaps, _LEAST_SIDE, rng):
        for left, right in cut(1, size - 1, gaps, _LEAST_SIDE, rng):
            walls[top:bottom, left:right] = False
        if rng.random() < _IN_LINE:
            cost[top:bottom] = 1
            cost[rng.integers(top, bottom)] = 0
        cost[bottom] = 2  # the wall to the next enfilade
    open_doors(walls, cost, _EXTRA_DOORS, rng)
    return np.rot90(walls, int(rng.integers(4))).copy()


MUSEUM = Kind("enfilades: rooms one after the other", museum_walls)
