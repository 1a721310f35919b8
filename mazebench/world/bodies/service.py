"""A service robot, as those in hospitals and shops: a differential drive as wide as a person."""

from mazebench.constants import STEP_TIME
from mazebench.world.bodies.rolling import RollingBody

SERVICE = RollingBody(
    name="service",
    radius=0.35,
    height=1.2,
    mass=60.0,
    top_speed=1.0,
    turn_step=1.5 * STEP_TIME,
    acceleration=1.0,
    turn_acceleration=3.0,
    camera_height=0.8,
    camera_offset=0.3,
)
