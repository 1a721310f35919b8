"""Sensors, observed besides the state and the map: one file per kind, and the tables of all of them."""

from __future__ import annotations

import dataclasses
from typing import Any

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
