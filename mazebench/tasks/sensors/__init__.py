"""Sensors, observed besides the state and the map: one file per kind, and the tables of all of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Iterable
from typing import Any

from mazebench.errors import InputError
from mazebench.options import fields_of
from mazebench.tasks.sensors.cameras import CameraOptions, CameraSensor
from mazebench.tasks.sensors.lidar import LidarOptions, LidarSensor
from mazebench.tasks.sensors.sensor import Sensor
from mazebench.world.looks import PICTURES

LIDAR = "lidar"  # the sensor of a track, unless others are named
SENSORS: dict[str, type[Sensor[Any]]] = {
    **dict.fromkeys(PICTURES, CameraSensor),
    LIDAR: LidarSensor,
}


@dataclasses.dataclass(frozen=True, kw_only=True)
class AllSensorOptions(LidarOptions, CameraOptions):
    """The options of all sensors: those of the last base come first."""


# By the option that says how wrong it is: the sensor. The other options are an agent's own choice.
NOISE_OF_SENSORS = {kind.noise: name for name, kind in SENSORS.items() if kind.noise}
CHOICES_OF_SENSORS = tuple(name for name in fields_of(AllSensorOptions) if name not in NOISE_OF_SENSORS)
# The options of a task without sensors, of a track with its own one alone.
WITHOUT_SENSORS = {"sensors": ()} | {name: option.default for name, option in fields_of(AllSensorOptions).items()}


def unread(reader: str, found: Iterable[str], read: Collection[str]) -> str | None:
    """Returns a line that names the observations or sensors that `reader` does not read; None if it reads all."""
    others = ", ".join(name for name in found if name not in read)
    return f"{reader}: reads {', '.join(read) or 'no sensors'}, found {others}" if others else None


def require_sensors_of_options(sensors: tuple[str, ...], changed: Iterable[tuple[str, Any]]) -> None:
    """Raises `InputError` if an option, changed to a value, is of no sensor that is observed."""
    used = {option for name in sensors for option in SENSORS[name].options_of(name)}
    for option, value in changed:
        if option in fields_of(AllSensorOptions) and option not in used:
            wanted = " or ".join(name for name, kind in SENSORS.items() if option in kind.options_of(name))
            raise InputError(f"{option} {value}: expected the sensor {wanted}, found {', '.join(sensors) or 'none'}")
