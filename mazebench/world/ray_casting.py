"""Distances from the body to the walls around it: an exact traversal of the maze's cells.

`K` is the number of bodies, `R = 32 K` the number of their rays, `N` the cells on a side of a maze.

Every ray is followed in a copy of its maze that is turned, clockwise by quarters, so that the ray points to the right
and upwards. Eight rays of a body share a copy. Arrays of rays are `[4, 8, K]`: quarter turn, ray, body.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mazebench.maps.drawn import FreshMazes, Mazes
from mazebench.maps.maze import Maze

NUM_RAYS = 32
MAX_RANGE = 5.0  # m

_STEP = 2 * np.pi / NUM_RAYS  # rad, from one ray to the next
_PER_TURN = NUM_RAYS // 4
_COS, _SIN = np.cos(np.arange(_PER_TURN) * _STEP), np.sin(np.arange(_PER_TURN) * _STEP)
_RAYS = np.stack([_COS, _SIN])[..., None]  # [2, 8, 1]: x and y of the rays that point to the right and upwards
_RAYS_TURNED = np.stack([-_SIN, _COS])[..., None]  # the same rays, turned by a quarter counter-clockwise
_PARALLEL = 1e-300  # the least component of a ray, so that the lines it is parallel to are far away but not at infinity
_NUM_FRESH = 512  # fresh mazes that are kept turned
# Which of (right, up, left, down) are x and y in the maze that is turned by 0, 1, 2 and 3 quarters.
_TURNED_AXES = np.array([[0, 1, 2, 3], [1, 2, 3, 0]])


class LidarModel(NamedTuple):
    """The model of a range sensor. The default is exact and sees as far as 5 m."""

    min_range: float = 0.0  # m
    max_range: float = MAX_RANGE  # m; what a ray reads that meets no wall this near
    sigma: float = 0.0  # m, the standard deviation of the noise on a distance
    step: float = 0.0  # m, between two distances that can be read; 0 for any
    lost: float = 0.0  # the share of rays that get no return

    @property
    def is_random(self) -> bool:
        """True if readings of the same scene differ."""
        return self.sigma > 0 or self.lost > 0


# The LDS-01 of a TurtleBot3: all but `lost` is as in ROBOTIS' own simulation of it (turtlebot3_simulations,
# turtlebot3_gazebo/models/turtlebot3_burger/model.sdf). That has no rays without return; a real sensor does, on dark or
# shiny walls and at grazing angles, and 2 % is our choice.
TURTLEBOT3 = LidarModel(min_range=0.12, max_range=3.5, sigma=0.01, step=0.015, lost=0.02)


def ray_ends(pose: np.ndarray, ranges: np.ndarray) -> np.ndarray:
    """Returns where rays of the lengths `ranges` (`[32]` m) end: `[32, 2]` float64, x and y in metres.

    The first ray of a body with the pose x, y (m) and yaw (rad), `[3]`, points straight ahead. The others follow
    counter-clockwise at equal angles.
    """
    angles = pose[2] + np.arange(NUM_RAYS) * _STEP
    return pose[:2] + ranges[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)


class Lidar:
    """The range sensor in some mazes of one size, whose cells have one size."""

    def __init__(self, mazes: Mazes, max_range: float = MAX_RANGE):
        """Sees as far as `max_range` (m)."""
        self._size, self._cell_size = mazes[0].size, mazes[0].cell_size
        self._max_range = max_range
        self._reach = max_range / self._cell_size  # cells
        self._mazes = mazes
        # Of fresh mazes, those that bodies are in.
        self._index_of: dict[int, int] | None = {} if isinstance(mazes, FreshMazes) else None
        self._allocate(_NUM_FRESH if isinstance(mazes, FreshMazes) else len(mazes))
        if not isinstance(mazes, FreshMazes):
            for index, maze in enumerate(mazes):
                self._put(index, maze)

    def _allocate(self, num_mazes: int) -> None:
        """Makes room for mazes: `[4, num_mazes, N, N]` bool, the free cells of each in four turns."""
        self._free = np.zeros((4, num_mazes, self._size, self._size), dtype=bool)
        self._first_maze = np.arange(4)[:, None] * num_mazes  # [4, 1], among the turned ones

    def _put(self, index: int, maze: Maze) -> None:
        # Rows from the bottom to the top, so that row and column are the integer parts of y and x.
        free = ~maze.walls[::-1]
        self._free[:, index] = [np.rot90(free, turns) for turns in range(4)]

    def _indices(self, maze: np.ndarray) -> np.ndarray:
        """Returns where some mazes are in `_free`, `[K]` int, and puts those that are not there into it."""
        if self._index_of is None:
            return maze
        numbers = maze.tolist()
        new = set(numbers) - self._index_of.keys()
        if len(self._index_of) + len(new) > self._free.shape[1]:  # begin anew, with those that are needed now
            self._index_of, new = {}, set(numbers)
            self._allocate(max(self._free.shape[1], 2 * len(new)))
        for number in new:
            self._put(len(self._index_of), self._mazes[number])
            self._index_of[number] = len(self._index_of)
        return np.array([self._index_of[number] for number in numbers])

    def ranges(self, maze: np.ndarray, pose: np.ndarray) -> np.ndarray:
        """Returns the distances to the nearest walls along the rays of K bodies: `[K, 32]` float32, m.

        `ray_ends` says where the rays point. The other bodies change no bit of a body's ranges.

        Args:
          maze: `[K]` int, the index of the maze that each body is in.
          pose: `[K, 3]` float64, the bodies' x, y (m) and yaw (rad, not wrapped).
        """
        num_bodies = len(pose)
        point, yaw = pose[:, :2].T / self._cell_size, pose[:, 2]
        heading = np.floor(yaw / _STEP)  # in steps, rounded down

        # The distances along the rays that point to the right and upwards, between two lines of constant x and of
        # constant y: [2, 8, K]. The first of these rays is less than a step from +x.
        rest = yaw - heading * _STEP
        spacing = 1.0 / np.maximum(np.cos(rest) * _RAYS + np.sin(rest) * _RAYS_TURNED, _PARALLEL)

        # Where the points lie in the mazes turned by 0, 1, 2 and 3 quarters: the number of the cell in `_free`, and the
        # distances to the next lines on the right and above.
        corner = np.floor(point)
        offset = point - corner
        gap = np.concatenate([1.0 - offset, offset]).take(_TURNED_AXES, axis=0)  # [2, 4, K]
        index = np.concatenate([corner, self._size - 1 - corner]).astype(np.int64)
        column, row = index.take(_TURNED_AXES, axis=0)
        in_free = self._indices(maze)  # before `_first_maze` is read, which it may change
        cell = ((self._first_maze + in_free) * self._size + row) * self._size + column  # [4, K]
        crossing = gap[:, :, None] * spacing[:, None]  # [2, 4, 8, K]
        cells = cell.repeat(_PER_TURN, axis=0).ravel()

        distances = self._traverse(cells, crossing.reshape(2, -1), spacing.reshape(2, -1))
        ranges = np.minimum(distances * self._cell_size, self._max_range).astype(np.float32)

        # The first of `ranges` is less than a step from +x, the first that is returned is straight ahead. With "wrap",
        # ray 0 follows ray 31.
        ray = (heading % NUM_RAYS).astype(np.int64)[:, None] + np.arange(NUM_RAYS)  # [K, 32]
        return ranges.take(ray * num_bodies + np.arange(num_bodies)[:, None], mode="wrap")

    def _traverse(self, cell: np.ndarray, crossing: np.ndarray, spacing: np.ndarray) -> np.ndarray:
        """Returns the distance at which each ray enters a wall, or one beyond its range: `[R]` float64, in cells.

        A ray goes from cell to cell, over the nearer of the next lines of constant x and of constant y (Amanatides and
        Woo, A Fast Voxel Traversal Algorithm for Ray Tracing, 1987).

        Args:
          cell: `[R]` int, which the rays begin in; overwritten.
          crossing: `[2, R]` cells along each ray, to the next line of constant x and to the next one of constant y.
          spacing: `[2, R / 4]` cells along each ray, between two such lines; the same for all four turns.
        """
        distances = np.empty(len(cell))
        ray = np.arange(len(cell))  # those that have met no wall
        while len(ray):
            # Enter the cell behind the nearer line.
            is_x = crossing[0] < crossing[1]
            distance = np.minimum(crossing[0], crossing[1])
            distances[ray] = distance
            cell += np.where(is_x, 1, self._size)

            # Go on with the rays that are in a free cell and in reach.
            # With "clip", a body that was never placed and stands outside the free cells does no harm.
            going_on = (self._free.take(cell, mode="clip") & (distance < self._reach)).nonzero()[0]
            ray, cell, is_x = ray.take(going_on), cell.take(going_on), is_x.take(going_on)

            # Move the line that was crossed on to the next one.
            step = spacing.take(ray, axis=1, mode="wrap")
            step[0] *= is_x
            step[1] *= ~is_x
            crossing = crossing.take(going_on, axis=1) + step
        return distances
