"""Sensors, observed besides the state and the map: one file per kind, and the table of all of them."""

from __future__ import annotations

from mazebench.tasks.sensors.cameras import CameraSensor
from mazebench.tasks.sensors.lidar import LidarSensor
from mazebench.tasks.sensors.sensor import Sensor
from mazebench.world.looks import PICTURES

LIDAR = "lidar"  # the sensor of a track, unless others are named
SENSORS: dict[str, type[Sensor]] = {
    **dict.fromkeys(PICTURES, CameraSensor),
    LIDAR: LidarSensor,
}
