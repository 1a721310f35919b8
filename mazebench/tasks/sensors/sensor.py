"""The base of sensors: a sensor says what it observes, and reads it off the true worlds of an environment."""

from __future__ import annotations

import abc
import dataclasses
from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np
from annotated_types import Interval
from dm_env import specs

from mazebench.constants import MAX_PIXELS
from mazebench.errors import InputError
from mazebench.maps.drawn import Mazes
from mazebench.options import Doc, OneOf, Options, ReadBy
from mazebench.world.looks import LOOKS, PLAIN, Camera
from mazebench.world.ray_casting import TURTLEBOT3, LidarModel

_CAMERA = Camera()
CAMERA_OPTIONS = ("camera_size", "camera_fov", "camera_height", "camera_offset", "camera_pitch", "look")
_NAMED = {"turtlebot3": TURTLEBOT3}


def noise_text(text: object) -> str | None:
    """Returns the text of the option in one form for each meaning: "turtlebot3", or as "0.1,0.05".

    Raises:
      InputError: if it is anything else.
    """
    if text is None or (isinstance(text, str) and text in _NAMED):
        return text
    try:
        sigma, lost = map(float, str(text).split(","))
    except ValueError:
        sigma = lost = np.nan
    if not (0 <= sigma <= 1 and 0 <= lost <= 1):
        raise InputError(
            f"expected lidar_noise 'turtlebot3', or SIGMA,LOST from 0 to 1 as '.1,.1', found {str(text)[:80]!r}"
        )
    return f"{sigma:g},{lost:g}"


@dataclasses.dataclass(frozen=True, kw_only=True)
class SensorOptions(Options):
    """The options that sensors read."""

    camera_size: Annotated[int, Interval(ge=1, le=MAX_PIXELS), Doc("Pixels on a side of a picture.")] = _CAMERA.size
    camera_fov: Annotated[
        float, Interval(ge=10, le=360), Doc("Degrees that a picture is wide; above 120, columns are at equal angles.")
    ] = _CAMERA.fov
    camera_height: Annotated[float, Interval(ge=0.1, le=0.9), Doc("Metres above the floor.")] = _CAMERA.height
    camera_offset: Annotated[float, Interval(ge=-0.15, le=0.15), Doc("Metres ahead of the body's centre.")] = (
        _CAMERA.offset
    )
    camera_pitch: Annotated[
        float, Interval(ge=-45, le=45), Doc("Degrees that the camera looks up; walls stay upright.")
    ] = _CAMERA.pitch
    look: Annotated[
        str,
        OneOf(*LOOKS),
        Doc(
            "plain: flat colours; varied: patterns, colours, light and signs that are each maze's own (training mazes "
            "have other patterns than the rest), with an exposure and noise that are each picture's own."
        ),
    ] = PLAIN
    lidar_noise: Annotated[
        str | None,
        ReadBy(noise_text),
        Doc(
            "turtlebot3 (.12 to 3.5 m, noise of .01 m, steps of .015 m, 2 % of rays lost), or SIGMA,LOST: the noise in "
            "metres and the share of rays that are lost, at 5 m reach; that of the track, or exact, if not given."
        ),
    ] = None

    @property
    def camera(self) -> Camera:
        """The camera of the sensors `egocentric`, `depth` and `labels`."""
        return Camera(self.camera_size, self.camera_fov, self.camera_height, self.camera_offset, self.camera_pitch)

    @property
    def is_unseen(self) -> bool:
        """True if mazes have patterns that training mazes don't have."""
        return False

    @property
    def lidar(self) -> LidarModel:
        """The model of the sensor `lidar`."""
        if self.lidar_noise is None or self.lidar_noise in _NAMED:
            return _NAMED[self.lidar_noise] if self.lidar_noise else LidarModel()
        sigma, lost = map(float, self.lidar_noise.split(","))
        return LidarModel(sigma=sigma, lost=lost)


class Worlds(NamedTuple):
    """The true state of K environments at one moment, as a sensor reads it."""

    maze: np.ndarray  # [K] int, index among the task's mazes
    pose: np.ndarray  # [K, 3] float64, of the body: x, y (m), yaw (rad, not wrapped)
    marker: np.ndarray  # [K, 3] float64, m: where the goal marker stands
    noise: Sequence[np.random.Generator | None]  # [K], draws the lidar's noise in an episode; None: there is none
    picture_noise: Sequence[np.random.Generator | None]  # [K], the same of pictures
    num_threads: int = 1  # in which they may be read; 0 for all cores


class Sensor(abc.ABC):
    """A kind of sensor, opened for the mazes of one environment. It may serve several names, as the camera does."""

    @classmethod
    @abc.abstractmethod
    def observation_spec(cls, name: str, options: SensorOptions) -> specs.BoundedArray:
        """Returns shape, type and range of what the sensor called `name` observes of one environment."""

    @abc.abstractmethod
    def __init__(self, names: tuple[str, ...], options: SensorOptions, mazes: Mazes):
        """Opens the sensors called `names`."""

    @abc.abstractmethod
    def read(self, worlds: Worlds) -> dict[str, np.ndarray]:
        """Returns `[K, ...]` by name: one observation, as in `observation_spec`, for each of K >= 1 worlds."""
