"""Distances to the walls of the true maze, from the true pose, as observations; noise may be on them.

`K` is the number of bodies.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from dm_env import specs

from mazebench.errors import InputError
from mazebench.maps.drawn import Mazes
from mazebench.options import Doc, ReadBy
from mazebench.tasks.sensors.sensor import Sensor, SensorOptions, Worlds
from mazebench.tasks.streams import Stream
from mazebench.world.ray_casting import NUM_RAYS, TURTLEBOT3, Lidar, LidarModel

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
class LidarOptions(SensorOptions):
    """The option of the lidar."""

    lidar_noise: Annotated[
        str | None,
        ReadBy(noise_text),
        Doc(
            "turtlebot3 (.12 to 3.5 m, noise of .01 m, steps of .015 m, 2 % of rays lost), or SIGMA,LOST: the noise in "
            "metres and the share of rays that are lost, at 5 m reach; that of the track, or exact, if not given."
        ),
    ] = None

    @property
    def lidar(self) -> LidarModel:
        """The model of the sensor `lidar`: as the option says, or the track."""
        if self.lidar_noise is None:
            return LidarModel() if self.track is None else TURTLEBOT3
        if self.lidar_noise in _NAMED:
            return _NAMED[self.lidar_noise]
        sigma, lost = map(float, self.lidar_noise.split(","))
        return LidarModel(sigma=sigma, lost=lost)


class LidarSensor(Sensor[LidarOptions]):
    """A range sensor at the body's centre, or where the body has it. It sees the walls only, neither body nor goal."""

    options = LidarOptions
    noise = "lidar_noise"

    @classmethod
    def told(cls, options: LidarOptions) -> Mapping[str, Any]:
        return {"lidar": options.lidar}

    @classmethod
    def observation_spec(cls, name: str, options: LidarOptions) -> specs.BoundedArray:
        # From 0, although a model may see nothing so near, because other libraries fill in zeros where nothing is.
        return specs.BoundedArray((NUM_RAYS,), np.float32, 0.0, options.lidar.max_range, name)

    def __init__(self, names: tuple[str, ...], options: LidarOptions, mazes: Mazes):
        (self._name,) = names
        self._model = options.lidar
        self.stream = Stream.LIDAR_NOISE if self._model.is_random else None
        self._is_exact = self._model == LidarModel(max_range=self._model.max_range)
        self._lidar = Lidar(mazes, self._model.max_range, options.driven_body.lidar_offset)

    def read(self, worlds: Worlds) -> dict[str, np.ndarray]:
        """Returns `[K, 32]` float32 by name, m: the rays of `Lidar.ranges`, as the model measures them."""
        ranges = self._lidar.ranges(worlds.maze, worlds.pose)
        return {self._name: ranges if self._is_exact else read(ranges, self._model, worlds.rngs)}


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
