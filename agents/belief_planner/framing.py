"""Shown maps on the grid of the maze's cells.

`P` is the side of a context in pixels, `M` the side of the map that is read from it, in cells.
"""

from __future__ import annotations

import cv2
import numpy as np

from mazebench.tasks import context as planes

from .belief import GOAL, NUM_PLANES, WALL

_BORDER = 1  # cells of wall on each side of a maze


def framed(context: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns the shown map and the goal's mark `[2, M, M]` float32 of a context `[4, P, P]`, and the marked starts.

    A picture of more pixels than cells is stretched so that its free pixels fill the cells inside of the border. The
    starts are cells `[S, 2]` int; S is 0 where none is marked.
    """
    picture, starts = context[planes.GLOBAL_MAP], np.argwhere(context[planes.START])
    if len(picture) <= size:
        return context[[planes.GLOBAL_MAP, planes.GOAL]], starts
    inside = size - 2 * _BORDER
    (top, bottom), (left, right) = (_free_span(picture.min(axis=1 - axis)) for axis in range(2))
    stretched = cv2.resize(picture[top:bottom, left:right], (inside, inside), interpolation=cv2.INTER_AREA)

    def cells(pixels: np.ndarray) -> np.ndarray:
        share = (pixels + 0.5 - (top, left)) / (bottom - top, right - left)
        return np.clip(np.floor(_BORDER + inside * share), 0, size - 1).astype(np.int64)

    shown = np.zeros((NUM_PLANES, size, size), dtype=np.float32)
    shown[WALL] = np.pad(stretched, _BORDER, constant_values=1)
    shown[(GOAL, *cells(np.argwhere(context[planes.GOAL])).T)] = 1
    return shown, cells(starts)


def _free_span(least: np.ndarray) -> tuple[int, int]:
    """Returns first and last pixel, plus one, where the least share of wall of rows or columns `[P]` is below half."""
    free = np.flatnonzero(least < 0.5)
    return (int(free[0]), int(free[-1]) + 1) if len(free) > 1 else (0, len(least))
