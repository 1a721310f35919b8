"""The agent's camera as a sensor: colours, depths and labels of the true world with the goal's disc in it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from annotated_types import Interval
from dm_env import specs

from mazebench.constants import MAX_PIXELS
from mazebench.maps.colors import GOAL, to_bytes
from mazebench.maps.moving_doors import StandingMazes
from mazebench.options import Doc, OneOf
from mazebench.tasks.sensors.sensor import Sensor, SensorOptions, Worlds
from mazebench.tasks.streams import Stream
from mazebench.world.looks import EXPOSURES, LOOKS, MAX_DEPTH, NUM_NOISE, PICTURES, PLAIN, VARIED, Camera

_CAMERA = Camera()
_LABEL_COLORS = np.array([(170, 205, 235), (150, 145, 135), (60, 80, 105), to_bytes(GOAL)], dtype=np.uint8)


def as_colors(name: str, picture: np.ndarray) -> np.ndarray:
    """Returns what a sensor observed as `[H, H, 3]` uint8, for people: depths in grey, white at 10 m."""
    if name == "labels":
        return _LABEL_COLORS[picture]
    return picture if name == "egocentric" else (picture[..., None] * ([255 / MAX_DEPTH] * 3)).astype(np.uint8)


@dataclasses.dataclass(frozen=True, kw_only=True)
class CameraOptions(SensorOptions):
    """The options of the camera."""

    camera_size: Annotated[int, Interval(ge=1, le=MAX_PIXELS), Doc("Pixels on a side of a picture.")] = _CAMERA.size
    camera_fov: Annotated[
        float, Interval(ge=10, le=360), Doc("Degrees that a picture is wide; above 120, columns are at equal angles.")
    ] = _CAMERA.fov
    camera_height: Annotated[
        float | None,
        Interval(ge=0.1, le=0.9),
        Doc("Metres above the floor; the body's if not given, 0.45 of the slider."),
    ] = None
    camera_offset: Annotated[
        float | None,
        Interval(ge=-0.15, le=0.15),
        Doc("Metres ahead of the body's centre; the body's if not given, 0.12 of the slider."),
    ] = None
    camera_pitch: Annotated[
        float, Interval(ge=-45, le=45), Doc("Degrees that the camera looks up; walls stay upright.")
    ] = _CAMERA.pitch
    look: Annotated[
        str,
        OneOf(*LOOKS),
        Doc(
            "plain: flat colours; varied: patterns, colours, light and signs that are each maze's own (train, dev and "
            "eval mazes have different patterns), with an exposure and noise that are each picture's own."
        ),
    ] = PLAIN

    @property
    def camera(self) -> Camera:
        """The camera of the sensors `egocentric`, `depth` and `labels`."""
        body = self.driven_body
        height = body.camera_height if self.camera_height is None else self.camera_height
        offset = body.camera_offset if self.camera_offset is None else self.camera_offset
        return Camera(self.camera_size, self.camera_fov, height, offset, self.camera_pitch)


class CameraSensor(Sensor[CameraOptions]):
    """Colours, depths and labels from one camera, which draws all of them at once."""

    options = CameraOptions

    @classmethod
    def options_of(cls, name: str) -> tuple[str, ...]:
        return tuple(option for option in super().options_of(name) if option != "look" or name == "egocentric")

    @classmethod
    def told(cls, options: CameraOptions) -> Mapping[str, Any]:
        return {"camera": options.camera}

    @classmethod
    def observation_spec(cls, name: str, options: CameraOptions) -> specs.BoundedArray:
        shape, kind, highest = PICTURES[name]
        return specs.BoundedArray((options.camera_size, options.camera_size, *shape), kind, 0, highest, name)

    def __init__(self, names: tuple[str, ...], options: CameraOptions, mazes: StandingMazes):
        # Imported here: who only reads a task's options, such as the command line, shall not load numba.
        from mazebench.world.ray_camera import RayCamera

        self._names = names
        self.stream = Stream.PICTURE_NOISE if options.look == VARIED else None
        self._camera = RayCamera(mazes, options.camera, options.look, options.look_split)
        self._exposures = np.log(EXPOSURES[options.look_split]).tolist()

    def read(self, worlds: Worlds) -> dict[str, np.ndarray]:
        """Returns `[K, H, H, ...]` by name, as in `PICTURES`."""
        count, (darkest, brightest) = len(worlds.pose), self._exposures
        gain, noise_at = np.ones(count, dtype=np.float32), np.full(count, -1)
        for i, rng in enumerate(worlds.rngs):
            if rng is not None:
                # As `rng.uniform(darkest, brightest)` and `rng.integers(NUM_NOISE)`, a power of 2, in half of the time.
                gain[i] = math.exp(darkest + (brightest - darkest) * rng.random())
                noise_at[i] = NUM_NOISE * rng.random(dtype=np.float32)
        return self._camera.take(
            self._names, worlds.maze, worlds.pose, worlds.marker, gain, noise_at, worlds.num_threads
        )
