"""Odometry: how far a body has moved, by its velocities, and by its positions where these tell it.

`B` is the number of environments.
"""

from __future__ import annotations

import dataclasses
from typing import TypeVar

import numpy as np

from mazebench.constants import STEP_TIME

from .body import FORWARD_VELOCITY, LEFT_VELOCITY, YAW, Body, Point, X, Y

_DRIFT = 0.035**2  # m^2, variance of a step's displacement as velocities tell it, along each axis; measured
_UNDISTURBED = 0.25**2  # m^2, mean square of what velocities don't tell of a step, at most, where positions are exact

_Velocity = TypeVar("_Velocity", float, np.ndarray)


def moved(velocity_tm1: _Velocity, velocity_t: _Velocity) -> _Velocity:
    """Returns how far a body moves in the step between two velocities: as far as at their mean."""
    return STEP_TIME * (velocity_tm1 + velocity_t) / 2


@dataclasses.dataclass
class DeadReckoning:
    """The position of one body, which adds up velocities, and follows the observed positions by a constant gain."""

    position: Point  # cells
    velocity: Point  # cells a second, at the last observation
    gain: float = 0.0  # weight of an observed position against the predicted one; 0 where it tells nothing

    def update(self, observed: Body) -> Body:
        """Takes in the body as it is observed one step on; returns it at the estimated position."""
        (x, y), (x_tm1, y_tm1), (x_t, y_t) = self.position, self.velocity, observed.velocity()
        x, y = x + moved(x_tm1, x_t), y + moved(y_tm1, y_t)
        x, y = (1 - self.gain) * x + self.gain * observed.x, (1 - self.gain) * y + self.gain * observed.y
        self.position, self.velocity = (x, y), (x_t, y_t)
        return observed._replace(x=x, y=y)


class Displacement:
    """The displacement since an episode began, in B environments, by a Kalman filter; exact positions are believed.

    Along each axis, the filter estimates the displacement and the place where it began. It measures their sum, the
    observed position. The variance of the noise is that of two positions in turn, beside the velocities between them.
    """

    def __init__(self, batch_size: int):
        self._first = np.zeros((batch_size, 2))  # the position observed first
        self._last = np.zeros((batch_size, 2))  # observed in the last step
        self._velocity = np.zeros((batch_size, 2))  # likewise
        self._squares = np.zeros(batch_size)  # sum over the steps, of one axis
        self._num_steps = np.zeros(batch_size)
        self._mean = np.zeros((batch_size, 2, 2))  # of displacement and beginning (first axis), for x and y
        self._variance = np.zeros((batch_size, 2, 2))  # their covariance, the same for x and y

    def update(self, state: np.ndarray, begins: np.ndarray) -> np.ndarray:
        """Returns the displacements `[B, 2]` float32 (m) after observed states `[B, 12]`.

        Args:
          state: what is observed.
          begins: `[B]` bool, whether an episode begins.
        """
        position = state[:, [X, Y]].astype(np.float64)
        velocity = turned(state[:, [FORWARD_VELOCITY, LEFT_VELOCITY]], state[:, YAW])
        step = moved(self._velocity, velocity)
        untold = position - self._last - step  # of the positions' difference by the velocities
        self._last, self._velocity = position, velocity
        goes = ~begins

        # The noise of positions.
        self._first[begins], self._squares[begins], self._num_steps[begins] = position[begins], 0.0, 0.0
        self._squares[goes] += (untold[goes] ** 2).mean(axis=1)
        self._num_steps[goes] += 1
        noise = np.maximum(self._squares / np.maximum(self._num_steps, 1) - _UNDISTURBED, 0.0) / 2

        # Where it begins is as uncertain as the first position, whose noise is known from the second one on.
        self._mean[begins, 0], self._mean[begins, 1] = 0.0, position[begins]
        second = self._num_steps == 1
        self._variance[second] = np.array([[0.0, 0.0], [0.0, 1.0]]) * noise[second, None, None]

        # Prediction.
        self._mean[goes, 0] += step[goes]
        self._variance[goes, 0, 0] += _DRIFT

        # Correction.
        shared = self._variance.sum(axis=2)  # covariances with the sum of both, which is measured
        gain = shared / (shared.sum(axis=1) + noise + 1e-12)[:, None]
        wrong = position - self._mean.sum(axis=1)
        self._mean[goes] += gain[goes, :, None] * wrong[goes, None]
        self._variance[goes] -= gain[goes, :, None] * shared[goes, None]

        exact = (noise == 0)[:, None]
        return np.where(exact, position - self._first, self._mean[:, 0]).astype(np.float32)


def turned(vector: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Returns vectors `[B, 2]`, turned by angles `[B]` (rad)."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.stack([cosine * vector[:, 0] - sine * vector[:, 1], sine * vector[:, 0] + cosine * vector[:, 1]], axis=1)
