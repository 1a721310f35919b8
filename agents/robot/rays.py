"""Rays through the cells of a map: the traversal of Amanatides & Woo 1987, A fast voxel traversal algorithm.

Lengths are in cells. A cell's level is its row counted from below, so that x and y lie in it if their integer parts are
column and level.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mazebench.kernels import compiled, inlined

_SMALLEST = 1e-12  # instead of a direction's component of 0


class Ray(NamedTuple):
    """A ray in one of the cells that it passes through; lengths along it count from its origin."""

    column: int
    level: int
    to_x: float  # length to the line x = constant at which it leaves the cell, unless it meets the other line before
    to_y: float  # likewise, y = constant
    spacing_x: float  # length between two lines x = constant
    spacing_y: float
    right: int  # by how much the column changes at a line x = constant, 1 or -1
    up: int


@inlined
def ray_from(x: float, y: float, along_x: float, along_y: float) -> Ray:
    """Returns the ray from (x, y) in the direction (along_x, along_y), a unit vector, in its first cell."""
    column, level = math.floor(x), math.floor(y)
    right, up = (1 if along_x > 0 else -1), (1 if along_y > 0 else -1)
    spacing_x, spacing_y = 1 / max(abs(along_x), _SMALLEST), 1 / max(abs(along_y), _SMALLEST)
    to_x = (column + 1 - x if right > 0 else x - column) * spacing_x
    to_y = (level + 1 - y if up > 0 else y - level) * spacing_y
    return Ray(column, level, to_x, to_y, spacing_x, spacing_y, right, up)


@inlined
def leaves_at(ray: Ray) -> float:
    """Returns the length at which the ray leaves its cell."""
    return min(ray.to_x, ray.to_y)


@inlined
def leaves_sideways(ray: Ray) -> bool:
    """Returns whether the ray leaves its cell at a line x = constant; at a corner, it goes up or down first."""
    return ray.to_x < ray.to_y


@inlined
def in_next_cell(ray: Ray) -> Ray:
    """Returns the ray in the cell that follows."""
    column, level, to_x, to_y, spacing_x, spacing_y, right, up = ray
    if leaves_sideways(ray):
        return Ray(column + right, level, to_x + spacing_x, to_y, spacing_x, spacing_y, right, up)
    return Ray(column, level + up, to_x, to_y + spacing_y, spacing_x, spacing_y, right, up)


@inlined
def is_on(ray: Ray, grid: np.ndarray) -> bool:
    """Returns whether the ray's cell is one of `grid` `[N, N]`."""
    return 0 <= ray.column < len(grid) and 0 <= ray.level < len(grid)


@compiled
def ranges_to(is_wall: np.ndarray, x: float, y: float, yaw: float, count: int, reach: float) -> np.ndarray:
    """Returns `[count]`: the lengths, at most `reach`, of rays from (x, y) to the walls of a grid `[L, L]` bool.

    The first ray points along `yaw`, the others follow counter-clockwise. There are no walls outside of the grid.
    """
    ranges = np.full(count, reach)
    for index in range(count):
        angle = yaw + index * (2 * math.pi / count)
        ray = ray_from(x, y, math.cos(angle), math.sin(angle))
        while leaves_at(ray) < reach:
            length = leaves_at(ray)
            ray = in_next_cell(ray)
            if not is_on(ray, is_wall):
                break
            if is_wall[len(is_wall) - 1 - ray.level, ray.column]:
                ranges[index] = length
                break
    return ranges
