"""Distances to the walls of the true maze, from the true pose, as observations; noise may be on them.

`K` is the number of bodies.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from dm_env import specs

from mazebench.maps.drawn import Mazes
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


def read(ranges: np.ndarray, model: LidarModel, rngs: Sequence[np.random.Generator | None]) -> np.ndarray:
    """Returns what a lidar reads: `[K, 32]` float32, m.

    A distance gets normal noise, is rounded to a multiple of the step, and is held between the least and the largest
    that can be read. A ray that meets no wall in reach reads the largest, and so does one whose return is lost.

    Args:
      ranges: `[K, 32]` m, the true distances, at most `model.max_range`.
      model: the lidar.
      rngs: `[K]`, of each body's episode; each draws 32 normal and 32 uniform numbers. None draws no noise.
    """
    from mazebench.world.ray_kernels import measure  # which needs numba

    normal, uniform = np.empty((2, *ranges.shape))
    for i, rng in enumerate(rngs):
        if rng is None:
            normal[i], uniform[i] = 0.0, 1.0
        else:
            rng.standard_normal(out=normal[i])
            rng.random(out=uniform[i])
    return measure(ranges, normal, uniform, *model)
