"""An open field with obstacles."""

from __future__ import annotations

import numpy as np

from mazebench.maps.kinds.kind import Kind, largest_area

_DENSITY = 0.25  # share of the inner cells that become walls


def obstacles_walls(size: int, rng: np.random.Generator) -> np.ndarray:
    """Returns the walls of an open field with single cells as walls: `[size, size]` bool.

    Free cells that can't be reached become walls.
    """
    walls = np.ones((size, size), dtype=bool)
    walls[1:-1, 1:-1] = rng.random((size - 2, size - 2)) < _DENSITY
    walls[tuple(rng.integers(1, size - 1, size=2))] = False
    return largest_area(walls)


OBSTACLES = Kind("an open field with single cells as walls", obstacles_walls, smallest=5)
