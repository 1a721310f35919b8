"""The base of sensors: a sensor says what it observes, and reads it off the true worlds of an environment."""

from __future__ import annotations

import abc
import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Generic, NamedTuple, TypeVar

import numpy as np
from dm_env import specs

from mazebench.maps.moving_doors import StandingMazes
from mazebench.options import Options, fields_of
from mazebench.tasks.streams import Stream
from mazebench.world.bodies import SLIDER, Body


@dataclasses.dataclass(frozen=True, kw_only=True)
class SensorOptions(Options):
    """The base of the options of a sensor, and what they depend on of the task."""

    @property
    def track(self) -> str | None:
        """The name of the track; None without one."""
        return None

    @property
    def driven_body(self) -> Body:
        """The body that the sensors are mounted on."""
        return SLIDER

    @property
    def look_split(self) -> str:
        """The split whose patterns and exposures pictures have."""
        return "train"


OwnOptions = TypeVar("OwnOptions", bound=SensorOptions)


class Worlds(NamedTuple):
    """The true state of K environments at one moment, as a sensor reads it."""

    maze: np.ndarray  # [K] int, index among the task's mazes
    pose: np.ndarray  # [K, 3] float64, of the body: x, y (m), yaw (rad, not wrapped)
    marker: np.ndarray  # [K, 3] float64, m: where the goal marker stands
    rngs: Sequence[np.random.Generator | None]  # [K], of the sensor's noise in the episodes; None where none is drawn
    num_threads: int = 1  # in which they may be read; 0 for all cores


class Sensor(abc.ABC, Generic[OwnOptions]):
    """A kind of sensor, opened for the mazes of one environment. It may serve several names, as the camera does."""

    options: ClassVar[type[SensorOptions]] = SensorOptions  # the class of its options
    # The option that says how wrong it is. It needs the sensor, and results name it. Other options are an agent's own
    # choice, as the sensor is.
    noise: ClassVar[str | None] = None

    stream: Stream | None = None  # of an episode, from which noise is drawn; None if none is

    @classmethod
    def options_of(cls, name: str) -> tuple[str, ...]:
        """Returns the options that make a difference to what the sensor called `name` observes, here all."""
        return tuple(fields_of(cls.options))

    @classmethod
    def told(cls, options: OwnOptions) -> Mapping[str, Any]:
        """Returns what agents know of it: values of fields of `Interface`."""
        return {}

    @classmethod
    @abc.abstractmethod
    def observation_spec(cls, name: str, options: OwnOptions) -> specs.BoundedArray:
        """Returns shape, type and range of what the sensor called `name` observes of one environment."""

    @abc.abstractmethod
    def __init__(self, names: tuple[str, ...], options: OwnOptions, mazes: StandingMazes):
        """Opens the sensors called `names`."""

    @abc.abstractmethod
    def read(self, worlds: Worlds) -> dict[str, np.ndarray]:
        """Returns `[K, ...]` by name: one observation, as in `observation_spec`, for each of K >= 1 worlds."""
