"""Odometry: how far a body has moved, by its velocities, and by its positions where these tell it."""

from __future__ import annotations

import dataclasses

from mazebench.constants import STEP_TIME

from .moving_body import MovingBody, Point


@dataclasses.dataclass
class DeadReckoning:
    """The position of one body, which adds up velocities, and follows the observed positions by a constant gain."""

    position: Point  # cells
    velocity: Point  # cells a second, at the last observation
    gain: float = 0.0  # weight of an observed position against the predicted one; 0 where it tells nothing

    def update(self, observed: MovingBody) -> MovingBody:
        """Takes in the body as it is observed one step on; returns it at the estimated position."""
        (x, y), (x_tm1, y_tm1), (x_t, y_t) = self.position, self.velocity, observed.velocity()
        # In a step, a body moves as far as at the mean of the velocities before and after.
        x, y = x + STEP_TIME * (x_tm1 + x_t) / 2, y + STEP_TIME * (y_tm1 + y_t) / 2
        x, y = (1 - self.gain) * x + self.gain * observed.x, (1 - self.gain) * y + self.gain * observed.y
        self.position, self.velocity = (x, y), (x_t, y_t)
        return observed._replace(x=x, y=y)
