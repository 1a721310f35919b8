"""The agent's camera as a sensor: colours, depths and labels of the true world with the goal's disc in it."""

from __future__ import annotations

import numpy as np
from dm_env import specs

from mazebench.maps.colors import GOAL, to_bytes
from mazebench.maps.drawn import Mazes
from mazebench.tasks.sensors.sensor import Sensor, SensorOptions, Worlds
from mazebench.world.looks import EXPOSURES, MAX_DEPTH, NUM_NOISE, PICTURES

_LABEL_COLORS = np.array([(170, 205, 235), (150, 145, 135), (60, 80, 105), to_bytes(GOAL)], dtype=np.uint8)


def as_colors(name: str, picture: np.ndarray) -> np.ndarray:
    """Returns what a sensor observed as `[H, H, 3]` uint8, for people: depths in grey, white at 10 m."""
    if name == "labels":
        return _LABEL_COLORS[picture]
    return picture if name == "egocentric" else (picture[..., None] * ([255 / MAX_DEPTH] * 3)).astype(np.uint8)


class CameraSensor(Sensor):
    """Colours, depths and labels from one camera, which draws all of them at once."""

    @classmethod
    def observation_spec(cls, name: str, options: SensorOptions) -> specs.BoundedArray:
        shape, kind, highest = PICTURES[name]
        return specs.BoundedArray((options.camera_size, options.camera_size, *shape), kind, 0, highest, name)

    def __init__(self, names: tuple[str, ...], options: SensorOptions, mazes: Mazes):
        # Imported here: who only reads a task's options, such as the command line, shall not load numba.
        from mazebench.world.ray_camera import RayCamera

        self._names = names
        self._camera = RayCamera(mazes, options.camera, options.look, options.is_unseen)

    def read(self, worlds: Worlds) -> dict[str, np.ndarray]:
        """Returns `[K, H, H, ...]` by name, as in `PICTURES`."""
        count, (darkest, brightest) = len(worlds.pose), np.log(EXPOSURES)
        gain, noise_at = np.ones(count, dtype=np.float32), np.full(count, -1)
        for i, rng in enumerate(worlds.picture_noise):
            if rng is not None:
                gain[i], noise_at[i] = np.exp(rng.uniform(darkest, brightest)), rng.integers(NUM_NOISE)
        return self._camera.take(
            self._names, worlds.maze, worlds.pose, worlds.marker, gain, noise_at, worlds.num_threads
        )
