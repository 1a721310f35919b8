"""How far the body has moved: a Kalman filter that weighs noisy positions against velocities.

`B` is the number of environments.
"""

from __future__ import annotations

import numpy as np

_STEP_TIME = 0.16  # s
_DRIFT = 0.035**2  # m^2, variance of a step's displacement as velocities tell it, along each axis; measured
_UNDISTURBED = 0.25**2  # m^2, mean square of what velocities don't tell of a step, at most, where positions are exact


class Displacement:
    """The displacement since an episode began, in B environments; exact positions are believed as they are.

    Along each axis, the filter estimates the displacement and the place where it began. It measures their sum. The
    variance of the noise is that of two positions in turn, beside the velocities between them.
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
        position, velocity = state[:, :2].astype(np.float64), turned(state[:, 6:8], state[:, 5])
        self._first[begins], self._squares[begins], self._num_steps[begins] = position[begins], 0.0, 0.0
        goes = ~begins
        moved = _STEP_TIME * (self._velocity + velocity) / 2
        told = position - self._last - moved
        self._squares[goes] += (told[goes] ** 2).mean(axis=1)
        self._num_steps[goes] += 1
        self._last, self._velocity = position, velocity
        noise = np.maximum(self._squares / np.maximum(self._num_steps, 1) - _UNDISTURBED, 0.0) / 2
        second = self._num_steps == 1
        self._mean[begins, 0], self._mean[begins, 1] = 0.0, position[begins]
        self._variance[second] = np.array([[0.0, 0.0], [0.0, 1.0]]) * noise[second, None, None]
        self._mean[goes, 0] += moved[goes]
        self._variance[goes, 0, 0] += _DRIFT
        shared = self._variance.sum(axis=2)  # with the sum of both
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
