"""The wall cells of a grid as few rectangles."""

from __future__ import annotations

from typing import Any, NamedTuple

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
    left_over = walls.copy()
    rectangles = []
    for top, left in np.argwhere(walls):
        if not left_over[top, left]:
            continue
        right = left + _leading(left_over[top, left:])
        bottom = top + _leading(left_over[top:, left:right].all(axis=1))
        left_over[top:bottom, left:right] = False
        rectangles.append(Rectangle(int(top), int(left), int(bottom), int(right)))
    return rectangles


def _leading(flags: Any) -> int:
    """Returns how many of `flags` are True before the first False."""
    return len(flags) if flags.all() else int(np.argmin(flags))
