"""Warehouses: rows of shelves with aisles between them."""

from __future__ import annotations

import numpy as np

from mazebench.maps.kinds.kind import Kind

_SHELF_DEPTHS = (1, 2)  # cells, the same for all shelves of a maze
_AISLE_WIDTHS = (1, 2)
_SHELF_LENGTHS = (3, 8)  # from, to


def warehouse_walls(size: int, rng: np.random.Generator) -> np.ndarray:
    """Returns the walls of rows of shelves: `[size, size]` bool.

    Aisles separate the rows. Gaps in a row, of one cell, and the aisle along the outer wall lead from aisle to aisle.
    """
    walls = np.ones((size, size), dtype=bool)
    walls[1:-1, 1:-1] = False
    depth, aisle = rng.choice(_SHELF_DEPTHS), rng.choice(_AISLE_WIDTHS)
    least, most = _SHELF_LENGTHS
    for top in range(1 + aisle, size - 1 - depth, depth + aisle):
        row = np.ones(size - 4, dtype=bool)
        gaps = np.cumsum(rng.integers(least + 1, most + 2, size=size)) - 1
        row[gaps[gaps < len(row)]] = False
        walls[top : top + depth, 2:-2] = row
    return walls if rng.random() < 0.5 else walls.T.copy()


WAREHOUSE = Kind("rows of shelves with aisles between them", warehouse_walls)
