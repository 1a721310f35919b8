"""Perspective transforms of a map: walls, points and cells seen through a homography.

A homography is `[3, 3]` float and maps (column, row) in cells, with the map's corners at 0 and N.
"""

from __future__ import annotations

import cv2
import numpy as np

from mazebench.maps.maze import Cell


def warp_walls(walls: np.ndarray, homography: np.ndarray) -> np.ndarray:
    """Returns `[N, N]` bool: `walls` seen through `homography`; outside of the map is wall."""
    # OpenCV puts the centre of the first pixel at 0, this package at 0.5.
    shift = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1]])
    warped = cv2.warpPerspective(
        walls.astype(np.uint8),
        np.linalg.inv(shift) @ homography @ shift,
        walls.shape[::-1],
        flags=cv2.INTER_NEAREST,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=1,
    )
    return warped.astype(bool)


def warp_points(points: np.ndarray, homography: np.ndarray, size: int) -> np.ndarray:
    """Returns `[T, 2]` float: where points (x, y) of a maze of `size` cells a side lie on the map seen through it."""
    rows = np.column_stack([points[:, 0], size - points[:, 1], np.ones(len(points))]) @ homography.T
    return np.column_stack([rows[:, 0] / rows[:, 2], size - rows[:, 1] / rows[:, 2]])


def warp_cell(cell: Cell, homography: np.ndarray, size: int) -> Cell:
    """Returns the cell in which the centre of `cell` lies, or the nearest one if it has left the map."""
    column, row, scale = homography @ (cell[1] + 0.5, cell[0] + 0.5, 1.0)
    row, column = np.clip(np.floor((row / scale, column / scale)), 0, size - 1).astype(int)
    return (int(row), int(column))
