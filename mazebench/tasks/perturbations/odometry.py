"""Observed poses that add up an observed motion: odometry, whose place on the map is unknown, and noisy motion."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Annotated

import numpy as np
from annotated_types import Interval

from mazebench.constants import FORWARD_VELOCITY, LEFT_VELOCITY, STEP_TIME, YAW, YAW_RATE, X, Y
from mazebench.options import Doc
from mazebench.tasks.perturbations.perturbation import Of, Perturbation, StateError
from mazebench.tasks.streams import Stream
from mazebench.world.angles import wrap_angle

_SCALES = (0.9, 1.1)  # lowest and highest of an episode's scale
_HEADING_WALK = math.radians(2.0)  # rad per root second
_VELOCITY = slice(6, 9)
# The motion after which AMCL updates, and draws anew: `update_min_d` and `update_min_a` of Nav2's parameters.
_SEGMENT, _SEGMENT_TURN = 0.25, 0.2  # m, rad

Pose = tuple[float, float, float]  # x, y (m), yaw (rad)

# The option that is alpha of `NoisyMotion`.
OdometryNoise = Annotated[
    float | None,
    Interval(ge=0, le=1),
    Doc(
        "alpha of the noise on the observed motion, AMCL's omnidirectional model (.2 is its default): the observed "
        "pose drifts away from the true one; that of the track, or 0, if not given."
    ),
]


@dataclasses.dataclass(frozen=True)
class LostPose(Perturbation):
    """Counts the observed pose from the place and the heading at the first step."""

    drifts: bool = False  # whether the odometry has a wrong scale and a heading that drifts

    of = Of.SENSES
    stream = Stream.LOST_POSE
    hides_pose = True

    def observed(self, rng: np.random.Generator) -> StateError:
        return Odometry(rng, float(rng.uniform(*_SCALES)), _HEADING_WALK) if self.drifts else Odometry(rng)


@dataclasses.dataclass(frozen=True)
class MotionNoise(Perturbation):
    """Adds noise to the observed motion, so that the observed pose drifts away from the true one."""

    alpha: float  # of `NoisyMotion`

    of = Of.SENSES
    stream = Stream.MOTION_NOISE
    option = "odometry_noise"

    def observed(self, rng: np.random.Generator) -> StateError:
        return NoisyMotion(self.alpha, rng)

    def told(self) -> Mapping[str, float]:
        return {"odometry_noise": self.alpha}


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
    _true: Pose | None = None  # the last one
    _observed: Pose = (0.0, 0.0, 0.0)

    def __call__(self, state: np.ndarray) -> None:
        """Changes a true state `[12]` in place; each call is the observation after the next agent step."""
        pose = x, y, yaw = state.item(X), state.item(Y), state.item(YAW)
        drift = 0.0
        if self._true is not None:
            drift = self.rng.normal(0.0, self.heading_walk * math.sqrt(STEP_TIME))
            true_x, true_y, true_yaw = self._true
            moved = self.scale * (x - true_x), self.scale * (y - true_y)
            self._observed = _moved_on(self._observed, moved, true_yaw, yaw, drift)
        self._true = pose
        state[X], state[Y], state[YAW] = self._observed
        state[_VELOCITY] *= self.scale
        state[YAW_RATE] += drift / STEP_TIME


@dataclasses.dataclass
class NoisyMotion:
    """Adds noise to the motion that the states of one episode tell of, after AMCL's omnidirectional model.

    The pose is that of the first state, and then adds up noisy motion. In a step that moves by d (m) and turns by t
    (rad), the errors along the way, across it and of the turn are normal with the standard deviation
    sqrt(alpha d^2 + alpha t^2) each: all five alphas of the model are the same one (`sample_motion_model` of Thrun,
    Burgard and Fox, Probabilistic Robotics, 2005, chapter 5, as Nav2 has it for bodies that can strafe:
    nav2_amcl/src/motion_model/omni_motion_model.cpp). AMCL draws once an update, which follows a motion of 0.25 m or
    0.2 rad. So the three standard normal numbers are drawn anew when the body has moved or turned as much, and kept
    until then: in how many steps it does so does not change how large the errors become. The observed velocities carry
    the same errors, divided by STEP_TIME.
    """

    alpha: float
    rng: np.random.Generator
    _true: Pose | None = None  # the last one
    _observed: Pose = (0.0, 0.0, 0.0)
    _along: float = 0.0  # the standard normal numbers of the present segment
    _across: float = 0.0
    _about: float = 0.0
    _moved: float = math.inf  # m, in the present segment; the first step begins one
    _turned: float = 0.0  # rad, likewise

    def __call__(self, state: np.ndarray) -> None:
        """Changes a state `[12]` in place; each call is the observation after the next agent step."""
        pose = x, y, yaw = state.item(X), state.item(Y), state.item(YAW)
        if self._true is None:
            self._true = self._observed = pose
            return
        true_x, true_y, true_yaw = self._true
        moved_x, moved_y, turn = x - true_x, y - true_y, wrap_angle(yaw - true_yaw)
        distance = math.hypot(moved_x, moved_y)

        # The segment.
        if self._moved >= _SEGMENT or self._turned >= _SEGMENT_TURN:
            self._along, self._across, self._about = self.rng.standard_normal(3).tolist()
            self._moved = self._turned = 0.0
        self._moved += distance
        self._turned += abs(turn)

        # The errors, in the frame of the true pose; a body that only turns has no way to be along or across of.
        deviation = math.sqrt(self.alpha * (distance * distance + turn * turn))
        way_x, way_y = (moved_x / distance, moved_y / distance) if distance else (1.0, 0.0)
        error_x = deviation * (self._along * way_x + self._across * way_y)
        error_y = deviation * (self._along * way_y - self._across * way_x)
        drift = deviation * self._about
        self._true = pose
        self._observed = _moved_on(self._observed, (moved_x + error_x, moved_y + error_y), true_yaw, yaw, drift)
        state[X], state[Y], state[YAW] = self._observed

        # The errors of the velocities, in the body's own frame.
        cosine, sine = math.cos(yaw), math.sin(yaw)
        state[FORWARD_VELOCITY] += (cosine * error_x + sine * error_y) / STEP_TIME
        state[LEFT_VELOCITY] += (cosine * error_y - sine * error_x) / STEP_TIME
        state[YAW_RATE] += drift / STEP_TIME


def _moved_on(observed: Pose, moved: tuple[float, float], true_yaw: float, yaw: float, drift: float) -> Pose:
    """Returns the observed pose after the next step.

    Args:
      observed: before the step.
      moved: x and y (m) of the step, in the frame of the true pose.
      true_yaw, yaw: the true one before and after the step.
      drift: rad, by which the observed pose turns more.
    """
    x, y, heading = observed
    moved_x, moved_y = moved

    # The motion in the body's frame, turned into the frame of odometry: one rotation by the difference.
    cosine, sine = math.cos(heading - true_yaw), math.sin(heading - true_yaw)
    return (
        x + cosine * moved_x - sine * moved_y,
        y + sine * moved_x + cosine * moved_y,
        wrap_angle(heading + yaw - true_yaw + drift),
    )
