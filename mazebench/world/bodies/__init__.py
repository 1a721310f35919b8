"""The bodies that can be driven, each in a file of its own."""

from mazebench.world.bodies.body import Body
from mazebench.world.bodies.slider import SLIDER

BODIES: dict[str, Body] = {body.name: body for body in (SLIDER,)}

__all__ = ["BODIES", "SLIDER", "Body"]
