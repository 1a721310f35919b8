"""The bodies that can be driven, each in a file of its own."""

from mazebench.world.bodies.body import Body
from mazebench.world.bodies.rolling import RollingBody
from mazebench.world.bodies.service import SERVICE
from mazebench.world.bodies.slider import SLIDER, SlidingBody
from mazebench.world.bodies.turtlebot3 import TURTLEBOT3, TURTLEBOT3_WAFFLE

BODIES: dict[str, Body] = {body.name: body for body in (SLIDER, TURTLEBOT3, TURTLEBOT3_WAFFLE, SERVICE)}

__all__ = ["BODIES", "SLIDER", "Body", "RollingBody", "SlidingBody"]
