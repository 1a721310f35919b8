"""Grids of cells, `[R, C]`, that are no mazes yet."""

from __future__ import annotations

import numpy as np
from scipy import ndimage


def largest_area(walls: np.ndarray) -> np.ndarray:
    """Returns `walls` (`[R, C]` bool) with all free cells closed but those of the largest connected area."""
    areas, _ = ndimage.label(~walls)
    sizes = np.bincount(areas.ravel())
    sizes[0] = 0
    return walls | (areas != np.argmax(sizes))  # all of them, if nothing is free
