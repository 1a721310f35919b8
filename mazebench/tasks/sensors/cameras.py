"""Pictures of the true world, the goal marker in it, as observations."""

from __future__ import annotations

import numpy as np
from dm_env import specs

from mazebench.maps.drawn import Mazes
from mazebench.tasks.sensors.sensor import Sensor, SensorOptions, Worlds


class CameraSensor(Sensor):
    """The cameras of the maze's model, all of them through one rendering context, which the first picture opens."""

    @classmethod
    def observation_spec(cls, name: str, options: SensorOptions) -> specs.BoundedArray:
        return specs.BoundedArray((options.camera_size, options.camera_size, 3), np.uint8, 0, 255, name)

    def __init__(self, names: tuple[str, ...], options: SensorOptions, mazes: Mazes):
        # Imported here: who only reads a task's options, such as the command line, shall not load MuJoCo.
        from mazebench.world.models import models_of
        from mazebench.world.rendering import Cameras

        self._names = names
        self._cameras = Cameras(models_of(mazes, options.textures), names, options.camera_size, smooth=False)

    def read(self, worlds: Worlds) -> dict[str, np.ndarray]:
        """Returns `[K, H, H, 3]` uint8 by name.

        Raises:
          RenderingError: if no rendering context can be opened.
        """
        pictures = [self._cameras.take(*world) for world in zip(worlds.maze, worlds.pose, worlds.marker, strict=True)]
        return {name: np.stack([taken[name] for taken in pictures]) for name in self._names}

    def close(self) -> None:
        self._cameras.close()
