"""Distances to the walls of the true maze, from the true pose, as observations; noise may be on them."""

from __future__ import annotations

import numpy as np
from dm_env import specs

from mazebench.maps.drawn import Mazes
from mazebench.tasks.sensors.lidar_noise import read
from mazebench.tasks.sensors.sensor import Sensor, SensorOptions, Worlds
from mazebench.world.ray_casting import NUM_RAYS, Lidar, LidarModel


class LidarSensor(Sensor):
    """A range sensor at the body's centre. It sees the walls only, neither the body nor the goal marker."""

    @classmethod
    def observation_spec(cls, name: str, options: SensorOptions) -> specs.BoundedArray:
        # From 0, although a model may see nothing so near, because other libraries fill in zeros where nothing is.
        return specs.BoundedArray((NUM_RAYS,), np.float32, 0.0, options.lidar.max_range, name)

    def __init__(self, names: tuple[str, ...], options: SensorOptions, mazes: Mazes):
        (self._name,) = names
        self._model = options.lidar
        self._is_exact = self._model == LidarModel(max_range=self._model.max_range)
        self._lidar = Lidar(mazes, self._model.max_range)

    def read(self, worlds: Worlds) -> dict[str, np.ndarray]:
        """Returns `[K, 32]` float32 by name, m: the rays of `Lidar.ranges`, as the model measures them."""
        ranges = self._lidar.ranges(worlds.maze, worlds.pose)
        return {self._name: ranges if self._is_exact else read(ranges, self._model, worlds.noise)}
