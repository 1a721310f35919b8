"""A layered costmap, after costmap_2d of Nav2: the map, the walls that the lidar marks and clears, and inflation.

`n` is the number of costmap cells on a side. Row 0 is at the top, x and y are in metres from the lower left corner.
"""

from __future__ import annotations

import math

import cv2
import numpy as np

from mazebench.kernels import compiled

from ..robot.rays import in_next_cell, is_on, leaves_at, ray_from

_WIDEST = 0.15  # m, the most that a cell is wide; Nav2's are 0.05 m, of which a maze has many more
_LOCAL_CELL = 0.036  # m, the most in the window around the robot
_INTO_WALL = 0.03  # m, by which the end of a ray lies in the cell that it marks
INFLATION = 0.55  # m from the robot's edge, up to which walls cost
_SCALING = 3.0  # 1/m, the rate at which costs decay, as in Nav2's example parameters


class Costmap:
    """The layers of one environment's costmap."""

    def __init__(self, walls: np.ndarray, width: float):
        """Reads the static layer of `walls`, `[M, M]` float with 1 at walls, of a maze `width` (m) wide."""
        self._per_pixel = math.ceil(width / len(walls) / _WIDEST)
        self.cell = width / len(walls) / self._per_pixel  # m
        self.width = width
        self.read(walls)
        self._seen = np.zeros(self._static.shape, dtype=np.int8)  # 1 where walls were marked, -1 where cleared

    def read(self, walls: np.ndarray) -> None:
        """Replaces the static layer."""
        self._static = (walls > 0.5).repeat(self._per_pixel, axis=0).repeat(self._per_pixel, axis=1)

    def forget(self) -> None:
        """Clears the obstacle layer."""
        self._seen[:] = 0

    def sense(self, x: float, y: float, yaw: float, ranges: np.ndarray, reach: float) -> None:
        """Clears cells along a scan's rays `[R]` (m), and marks those where they end; rays of `reach` do nothing."""
        mark_and_clear(self._seen, x / self.cell, y / self.cell, yaw, ranges / self.cell, reach / self.cell,
                       _INTO_WALL / self.cell)  # fmt: skip

    def clearance(self) -> np.ndarray:
        """Returns `[n, n]` float32: the metres from the middle of each cell to that of the nearest wall's."""
        walls = np.where(self._seen == 0, self._static, self._seen > 0)
        return _distances(walls, self.cell)

    def clearance_around(self, x: float, y: float, radius: float) -> tuple[np.ndarray, float, float, float]:
        """Returns that of finer cells in a window, which holds all that is at most `radius` (m) from (x, y).

        Beside it: the window's left and upper end (m), and the width of its cells (m).
        """
        n, margin = len(self._seen), math.ceil(radius / self.cell)
        row, column = n - 1 - int(y / self.cell), int(x / self.cell)
        top, left = max(row - margin, 0), max(column - margin, 0)
        window = slice(top, row + margin + 1), slice(left, column + margin + 1)
        walls = np.where(self._seen[window] == 0, self._static[window], self._seen[window] > 0)
        finer = math.ceil(self.cell / _LOCAL_CELL)
        walls = walls.repeat(finer, axis=0).repeat(finer, axis=1)
        return _distances(walls, self.cell / finer), left * self.cell, (n - top) * self.cell, self.cell / finer


def _distances(walls: np.ndarray, cell: float) -> np.ndarray:
    return cv2.distanceTransform((~walls).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * np.float32(cell)


@compiled
def cost(clearance: float, radius: float) -> float:
    """Returns the cost of a place from 0 to 1, by Nav2's inflation layer; 1 within the robot's radius."""
    if clearance >= INFLATION + radius:
        return 0.0
    return math.exp(-_SCALING * max(clearance - radius, 0.0))


@compiled
def mark_and_clear(
    seen: np.ndarray, x: float, y: float, yaw: float, ranges: np.ndarray, reach: float, into_wall: float
) -> None:
    """Clears the cells of `seen` `[n, n]` along rays, and marks those where they end; all lengths are in cells."""
    n = len(seen)
    for sets in (-1, 1):  # what one ray marks, no other one clears
        for index in range(len(ranges)):
            length = ranges[index]
            if length >= reach:
                continue
            angle = yaw + index * (2 * math.pi / len(ranges))
            along_x, along_y = math.cos(angle), math.sin(angle)
            if sets > 0:
                end = ray_from(x + (length + into_wall) * along_x, y + (length + into_wall) * along_y, along_x, along_y)
                if is_on(end, seen):
                    seen[n - 1 - end.level, end.column] = 1
                continue
            ray = ray_from(x, y, along_x, along_y)
            while is_on(ray, seen):
                seen[n - 1 - ray.level, ray.column] = -1
                if leaves_at(ray) >= length - into_wall:
                    break
                ray = in_next_cell(ray)
