"""Distances to the walls of the true maze, from the true pose, as observations."""

from __future__ import annotations

import numpy as np
from dm_env import specs

from mazebench.maps.maze import Maze
from mazebench.tasks.sensors.base import Sensor, SensorOptions, Worlds
from mazebench.world.lidar import MAX_RANGE, NUM_RAYS, Lidar


class LidarSensor(Sensor):
    """A range sensor at the body's centre. It sees the walls only, neither the body nor the goal's marker."""

    @classmethod
    def observation_spec(cls, name: str, options: SensorOptions) -> specs.BoundedArray:
        return specs.BoundedArray((NUM_RAYS,), np.float32, 0.0, MAX_RANGE, name)

    def __init__(self, names: tuple[str, ...], options: SensorOptions, mazes: tuple[Maze, ...]):
        (self._name,) = names
        self._lidar = Lidar(mazes)

    def read(self, worlds: Worlds) -> dict[str, np.ndarray]:
        """Returns `[K, 32]` float32 by name, as `Lidar.ranges` does."""
        return {self._name: self._lidar.ranges(worlds.maze, worlds.pose)}
