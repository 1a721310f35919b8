"""Perturbations of the map an agent is shown; the world never changes."""

from __future__ import annotations

import cv2
import numpy as np

from mazebench.errors import InputError
from mazebench.maps.maze import Cell

# Moving every corner by less than this share of the side keeps the four corners a convex quadrilateral.
MAX_WARP = 0.25


def flip(walls: np.ndarray, probability: float, keep: list[Cell], rng: np.random.Generator) -> np.ndarray:
    """`[N, N]` bool: `walls` with each inner cell flipped with `probability`, but for the cells to `keep`."""
    flipped = rng.random(walls.shape) < probability
    flipped[[0, -1]] = flipped[:, [0, -1]] = False
    for cell in keep:
        flipped[cell] = False
    return walls ^ flipped


def random_homography(size: int, share: float, rng: np.random.Generator) -> np.ndarray:
    """`[3, 3]` float: a perspective transform that moves each corner of a map by uniform(-share, share) of its side.

    The corner moves so in x and in y. Coordinates are (column, row) in cells, with the map's corners at 0 and `size`.

    Raises:
      InputError: if `share` is not in [0, 0.25].
    """
    if not 0 <= share <= MAX_WARP:
        raise InputError(f"expected a map warp from 0 to {MAX_WARP}, found {share}")
    corners = np.array([[0, 0], [size, 0], [size, size], [0, size]], dtype=np.float32)
    moved = corners + size * rng.uniform(-share, share, size=(4, 2)).astype(np.float32)
    return cv2.getPerspectiveTransform(corners, moved)


def warp_walls(walls: np.ndarray, homography: np.ndarray) -> np.ndarray:
    """`[N, N]` bool: `walls` seen through `homography`, each cell taking the value at its centre; outside is wall."""
    # OpenCV puts the centre of the first pixel at 0, we at 0.5.
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
    """`[T, 2]` float: where points (x, y) of a maze of `size` cells a side come to lie on the map seen through it."""
    rows = np.column_stack([points[:, 0], size - points[:, 1], np.ones(len(points))]) @ homography.T
    return np.column_stack([rows[:, 0] / rows[:, 2], size - rows[:, 1] / rows[:, 2]])


def warp_cell(cell: Cell, homography: np.ndarray, size: int) -> Cell:
    """Where the centre of `cell` comes to lie, moved into the map if it leaves it."""
    column, row, scale = homography @ (cell[1] + 0.5, cell[0] + 0.5, 1.0)
    row, column = np.clip(np.floor((row / scale, column / scale)), 0, size - 1).astype(int)
    return (int(row), int(column))
