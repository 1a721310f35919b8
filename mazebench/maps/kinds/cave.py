"""Caves, made by a cellular automaton."""

from __future__ import annotations

import numpy as np
import scipy

from mazebench.maps.kinds.kind import Kind, largest_area

_DENSITY = 0.46  # share of the cells that are rock at first
_GENERATIONS = 3
_SMALLEST_SHARE = 0.4  # of the inner cells: smaller caves are drawn anew


def cave_walls(size: int, rng: np.random.Generator) -> np.ndarray:
    """Returns the walls of a cave: `[size, size]` bool.

    A cellular automaton makes rock of each cell that has rock in at least 5 of the 9 cells around it, itself included.
    """
    while True:
        rock = np.ones((size, size), dtype=np.int8)
        rock[1:-1, 1:-1] = rng.random((size - 2, size - 2)) < _DENSITY
        for _ in range(_GENERATIONS):
            # Beyond the border is rock.
            around = scipy.ndimage.uniform_filter(9.0 * rock, 3, mode="constant", cval=9.0)
            rock[1:-1, 1:-1] = around[1:-1, 1:-1] > 4.5
        walls = largest_area(rock == 1)
        if (~walls).sum() >= _SMALLEST_SHARE * (size - 2) ** 2:
            return walls


CAVE = Kind("a cave, by a cellular automaton", cave_walls)
