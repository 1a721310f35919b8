"""The track `lost`: the observed pose is odometry, whose place and heading on the map are unknown."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from mazebench.constants import STEP_TIME
from mazebench.maps.maze import Cell
from mazebench.tasks.context import LOCAL_MAP, START
from mazebench.tasks.perturbations.base import ShownMap, StateError
from mazebench.tasks.tracks.base import Track
from mazebench.world.angles import wrap_angle

_SCALES = (0.9, 1.1)  # lowest and highest of an episode's scale
_HEADING_WALK = math.radians(2.0)  # rad per root second
_X, _Y, _YAW, _VELOCITY, _YAW_RATE = 0, 1, 5, slice(6, 9), 11  # indices in a state


class Lost(Track):
    """The pose is odometry: it counts from the place and the heading at the first step, which the map need not tell."""

    help = "The pose is odometry, which does not tell where on the map the body is."
    stream = 6
    levels = (
        "the start is marked, the heading is unknown",
        "and the start is unknown: planes 1 and 3 of the context are zero",
        "and the odometry drifts: its scale is off by up to 10 %, its heading walks by 2 degrees per root second",
    )
    refused_sensors = ("top", "chase")

    def show(self, shown: ShownMap, level: float, ends: tuple[Cell, Cell], rng: np.random.Generator) -> ShownMap:
        return dataclasses.replace(shown, hidden=(LOCAL_MAP, START)) if level >= 2 else shown

    def state_error(self, level: float, rng: np.random.Generator) -> StateError:
        return corrupted_odometry(rng) if level >= 3 else Odometry(rng)


def corrupted_odometry(rng: np.random.Generator) -> Odometry:
    """Returns the odometry of an episode, with a drawn scale and a heading that drifts."""
    return Odometry(rng, float(rng.uniform(*_SCALES)), _HEADING_WALK)


@dataclasses.dataclass
class Odometry:
    """Turns the true states of one episode into those of a body that adds up its own motion.

    The pose is x = y = yaw = 0 at the first observation. Between two observations, the true pose moves forward, to the
    left and about the body by (f, l, t). The observed pose then moves by (s f, s l, t + w) in its own frame. s is the
    scale, and w is drawn from a normal distribution with the standard deviation `heading_walk` * sqrt(STEP_TIME). The
    observed velocities carry the same errors: the linear ones are multiplied by s, and w / STEP_TIME is added to the
    yaw rate. z, roll, pitch and the other angular velocities stay true.
    """

    rng: np.random.Generator  # draws w
    scale: float = 1.0
    heading_walk: float = 0.0  # rad per root second
    _true: tuple[float, float, float] | None = None  # the last true pose: x, y (m), yaw (rad)
    _observed: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __call__(self, state: np.ndarray) -> None:
        """Changes a true state `[12]` in place; each call is the observation after the next agent step."""
        x, y, yaw = state.item(_X), state.item(_Y), state.item(_YAW)
        drift = 0.0
        if self._true is not None:
            drift = self.rng.normal(0.0, self.heading_walk * math.sqrt(STEP_TIME))
            self._advance(x, y, yaw, drift)
        self._true = (x, y, yaw)
        state[_X], state[_Y], state[_YAW] = self._observed
        state[_VELOCITY] *= self.scale
        state[_YAW_RATE] += drift / STEP_TIME

    def _advance(self, x: float, y: float, yaw: float, drift: float) -> None:
        """Moves the observed pose as the true one moved to (x, y, yaw), and turns it by `drift` (rad) more."""
        assert self._true is not None
        true_x, true_y, true_yaw = self._true
        odometry_x, odometry_y, heading = self._observed

        # The true motion in the body's frame, turned into the frame of odometry: one rotation by the difference.
        cosine, sine = math.cos(heading - true_yaw), math.sin(heading - true_yaw)
        moved_x, moved_y = self.scale * (x - true_x), self.scale * (y - true_y)
        self._observed = (
            odometry_x + cosine * moved_x - sine * moved_y,
            odometry_y + sine * moved_x + cosine * moved_y,
            wrap_angle(heading + yaw - true_yaw + drift),
        )
