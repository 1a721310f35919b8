"""Mazes in which one can say by hand where a body gets to, how far a point is from walls, and another body."""

from __future__ import annotations

import dataclasses

import numpy as np

from mazebench.maps.maze import Maze, point_to_cell
from mazebench.world.bodies import SLIDER

# Wider, heavier and half as fast.
CART = dataclasses.replace(
    SLIDER, name="cart", radius=0.2, mass=2.0, top_speed=1.6, fastest=1.14 * 1.6, drive_force=17.0
)


def field(size: int) -> Maze:
    """Returns a maze without walls but for its border."""
    return Maze(np.pad(np.zeros((size - 2, size - 2), dtype=bool), 1, constant_values=True), "field")


def corridor() -> Maze:
    """Returns 7 free cells in a row, from (1, 1) to (1, 7) of 9 x 9."""
    walls = np.ones((9, 9), dtype=bool)
    walls[1, 1:8] = False
    return Maze(walls, "corridor")


def clearance(walls: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Returns `[K]` cells: how far `[K, 2]` points are from the nearest wall, infinite where none is near."""
    cells = point_to_cell(points, len(walls))
    nearest = np.full(len(points), np.inf)
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            row, column = np.clip(cells + np.array([down, right]), 0, len(walls) - 1).T
            centre = np.stack([column + 0.5, len(walls) - row - 0.5], axis=-1)
            distance = np.hypot(*np.maximum(np.abs(points - centre) - 0.5, 0).T)
            nearest = np.where(walls[row, column], np.minimum(nearest, distance), nearest)
    return nearest
