"""The task context: map, local map, goal and start as `[4, M, M]` planes."""

from __future__ import annotations

import cv2
import numpy as np

from mazebench.maps.maze import Cell

NUM_PLANES = 4
MAX_CONTEXT_SIZE = 255
GLOBAL_MAP, LOCAL_MAP, GOAL, START = range(NUM_PLANES)
_LARGEST_DEFAULT_SIZE = 21


def default_context_size(size: int) -> int:
    """Returns M for mazes of `size` cells on a side: their own size, at most 21."""
    return min(size, _LARGEST_DEFAULT_SIZE)


def build_context(walls: np.ndarray, start: Cell, goal: Cell, context_size: int) -> np.ndarray:
    """Returns `[4, M, M]` float32 in [0, 1]: the context of a leg from `start` to `goal` on the shown map.

    Walls and marks are 1. Plane 0 is the map, resized to M x M. Plane 1 is the M x M cells around the start, with the
    start at (M // 2, M // 2); outside of the map is wall. Plane 2 marks the goal, plane 3 the start: a cell (r, c) of
    N x N is marked at (r M // N, c M // N).
    """
    size = len(walls)
    context = np.zeros((NUM_PLANES, context_size, context_size), dtype=np.float32)
    context[GLOBAL_MAP] = resized_map(walls, context_size)

    # The part of the map around the start, whose cell (r, c) is cell (r - row, c - column) of the local map.
    row, column = start[0] - context_size // 2, start[1] - context_size // 2
    top, bottom = max(0, row), min(size, row + context_size)
    left, right = max(0, column), min(size, column + context_size)
    context[LOCAL_MAP] = 1
    context[LOCAL_MAP, top - row : bottom - row, left - column : right - column] = walls[top:bottom, left:right]

    context[GOAL, goal[0] * context_size // size, goal[1] * context_size // size] = 1
    context[START, start[0] * context_size // size, start[1] * context_size // size] = 1
    return context


def resized_map(walls: np.ndarray, context_size: int) -> np.ndarray:
    """Returns `[M, M]` float32: the share of wall in each of M x M equal parts; the nearest cell if M > N."""
    if context_size == len(walls):
        return walls
    interpolation = cv2.INTER_AREA if context_size < len(walls) else cv2.INTER_NEAREST
    return cv2.resize(walls.astype(np.float32), (context_size, context_size), interpolation=interpolation)
