"""The wall cells of a grid as few rectangles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Rectangle(NamedTuple):
    """Cells of rows [top, bottom) and columns [left, right)."""

    top: int
    left: int
    bottom: int
    right: int


def cover(walls: np.ndarray) -> list[Rectangle]:
    """Returns disjoint rectangles that cover the True cells of `walls` (`[N, N]` bool).

    Each starts at the first cell left in reading order, and grows first to the right, then down.
    """
    # As bytes, in which Python finds cells faster than NumPy does in rows this short.
    rows = [bytearray(row) for row in walls.astype(np.uint8)]
    rectangles = []
    for top, row in enumerate(rows):
        while (left := row.find(1)) >= 0:
            end = row.find(0, left)
            right = len(row) if end < 0 else end
            filled, bottom = row[left:right], top
            while bottom < len(rows) and rows[bottom].startswith(filled, left):
                rows[bottom][left:right] = bytes(right - left)
                bottom += 1
            rectangles.append(Rectangle(top, left, bottom, right))
    return rectangles
