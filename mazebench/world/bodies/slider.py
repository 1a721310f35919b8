"""The body of the paper's protocol and of the tracks, which moves like DeepMind Lab's.

1 m stands for 100 game units. The numbers are fitted to measurements in DeepMind Lab, which docs/task.md lists.
"""

import math

from mazebench.constants import SLIDER_RADIUS
from mazebench.world.bodies.body import Body

SLIDER = Body(
    name="slider",
    radius=SLIDER_RADIUS,  # DeepMind Lab's box is 30 x 30 x 56 units
    height=0.56,
    mass=1.0,
    yaw_inertia=0.02,
    top_speed=3.2,
    # A drive pushes the body to its top speed ahead. While it turns, it is pushed aside, too. Let v be its speed and c
    # the cosine of the angle between push and motion. v grows only while the push along it, c times at most 34 N, is
    # above the damping, 8 v: v < 4.25 c. The push falls below 34 N at v c = 3.06. So v can't grow beyond the v at which
    # both hold, 3.61 m/s. With two drives at once, as velocities set them, it is 3.643 m/s, over all pairs of them and
    # all angles.
    fastest=1.14 * 3.2,
    turn_step=math.radians(21.12),  # in 10 frames, 20 pixels of 0.1056 degrees each
    damping=8.0,
    drive_gain=60.0,
    drive_force=34.0,
    yaw_gain=20.0,  # with the inertia a time constant of 1 ms, well within a frame
)
