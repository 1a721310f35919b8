"""The TurtleBot3 of ROBOTIS, a small differential drive, as burger and as waffle.

Radius, height, mass, speed and turn rate are those of its e-manual. The accelerations are those of the dynamic window
in its package turtlebot3_navigation. The lidar is where its model for ROS, turtlebot3_description, has it. A burger
comes without a camera, and we put one in front.
"""

import dataclasses

from mazebench.constants import STEP_TIME
from mazebench.world.bodies.rolling import RollingBody

TURTLEBOT3 = RollingBody(
    name="turtlebot3",
    radius=0.105,
    height=0.192,
    mass=1.0,
    top_speed=0.22,
    turn_step=2.84 * STEP_TIME,
    acceleration=2.5,
    turn_acceleration=3.2,
    camera_height=0.12,
    camera_offset=0.05,
    lidar_offset=-0.032,
)
TURTLEBOT3_WAFFLE = dataclasses.replace(
    TURTLEBOT3,
    name="turtlebot3-waffle",
    radius=0.22,
    height=0.141,
    mass=1.8,
    top_speed=0.26,
    turn_step=1.82 * STEP_TIME,
    camera_height=0.1,
    camera_offset=0.073,
    lidar_offset=-0.064,
)
