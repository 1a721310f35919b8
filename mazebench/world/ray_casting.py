"""Distances from the body to the walls around it: an exact traversal of the maze's cells.

`K` is the number of bodies, `N` the cells on a side of a maze.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mazebench.maps.drawn import MazeRows, Mazes

NUM_RAYS = 32
MAX_RANGE = 5.0  # m


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
    angles = pose[2] + np.arange(NUM_RAYS) * (2 * np.pi / NUM_RAYS)
    return pose[:2] + ranges[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)


def ahead_of(pose: np.ndarray, offset: float) -> np.ndarray:
    """Returns the poses `[..., 3]` of sensors that are mounted `offset` (m) ahead of poses of bodies."""
    if offset == 0:
        return pose
    x, y, yaw = np.moveaxis(pose, -1, 0)
    return np.stack([x + offset * np.cos(yaw), y + offset * np.sin(yaw), yaw], axis=-1)


class Lidar:
    """The range sensor in some mazes of one size, whose cells have one size."""

    def __init__(self, mazes: Mazes, max_range: float = MAX_RANGE, offset: float = 0.0):
        """Sees as far as `max_range` (m) from a point `offset` (m) ahead of the bodies' centres."""
        self._max_range, self._cell_size, self._offset = max_range, mazes[0].cell_size, offset
        self._walls = MazeRows(lambda number: (mazes[number].walls,))

    def ranges(self, maze: np.ndarray, pose: np.ndarray) -> np.ndarray:
        """Returns the distances to the nearest walls along the rays of K bodies: `[K, 32]` float32, m.

        `ray_ends` says where the rays point. The other bodies change no bit of a body's ranges.

        Args:
          maze: `[K]` int, the index of the maze that each body is in.
          pose: `[K, 3]` float64, the bodies' x, y (m) and yaw (rad, not wrapped).
        """
        from mazebench.world.ray_kernels import cast  # which needs numba

        pose = ahead_of(pose, self._offset)
        places = self._walls.places(maze)  # before the walls are read, which it may replace
        return cast(*self._walls.arrays, places, pose, NUM_RAYS, self._cell_size, self._max_range)
