"""Follows the pose on a grid of walls: odometry predicts it, and a scan that is matched with the grid corrects it.

The grid holds what was seen before, so this needs no map: it is the localization of a robot that maps (Thrun, Burgard &
Fox 2005, Probabilistic Robotics, chapters 5 and 6). Walls end at lines of the grid's cells. So even a grid on which
nothing was seen tells the heading up to quarter turns and the position within a cell.

Lengths are in cells, but constants in metres. A pose is x, y and yaw (rad) in the grid's frame.
"""

from __future__ import annotations

import cmath
import dataclasses
import math

import numpy as np

from mazebench.constants import STEP_TIME
from mazebench.kernels import compiled, inlined

from .beams import Beams, log_likelihood, log_likelihoods
from .moving_body import MovingBody
from .occupancy import seen_walls

_DEVIATION = 0.03  # m, of a position that was matched
_TEMPER = 0.5  # weight of a scan against the odometry: rays share errors

# Standard deviations of a step, beside what the odometry's noise makes: what its scale and its heading may be off.
_SCALE_ERROR = 0.07  # share of the way
_SHIFT = 0.03  # m
_TURN = 0.025  # rad
_OFF = 0.1  # m, of a position from the commanded one; contacts with walls that were not seen make more
_LARGEST_WAY = 1.0  # m in a step; more is no motion
# The scale is uniform in .9 to 1.1, and corrected steps are 0.02 m off. The ratio of these variances is what a scale of
# 1 weighs against squared steps.
_SCALE_PRIOR = 0.02**2 / (0.2**2 / 12)

_NUM_HEADINGS = 90  # that are tried in a quarter turn
_STARTS = 3  # from which the best pose is searched
_SHIFTED = 0.06  # m; of a larger deviation, the search also begins beside the predicted pose
_FIRST_STEP, _LAST_STEP = 0.08, 0.006  # m, of the search
_TURN_PER_STEP = 0.5  # rad a metre
_MOST_MOVES = 8  # with steps of one length


@dataclasses.dataclass
class Tracker:
    """The pose of one body, and what is known of its odometry."""

    pose: np.ndarray  # [3] float
    odometry: np.ndarray  # [3] float, x, y and yaw as they were observed last
    noise: float = 0.0  # alpha of the odometry (AMCL's model)
    driven: float = _SCALE_PRIOR  # the sum of the odometry's squared steps (m) and of the prior
    moved: float = _SCALE_PRIOR  # the sum of these steps' products with the corrected ones and of the prior
    error: complex = 0j  # of the odometry's last step, forward + left j in the body's frame, cells

    def update(
        self, walls: np.ndarray, odometry: np.ndarray, commanded: np.ndarray, ranges: np.ndarray, beams: Beams
    ) -> None:
        """Takes in an observed pose `odometry` `[3]` and a scan `ranges` `[R]`.

        `walls` `[L, L]` are the probabilities by what was seen before, `commanded` `[3]` the pose by the last action.
        """
        x, y, yaw = self.pose.tolist()
        step_x, step_y, turned = (odometry - self.odometry).tolist()
        self.odometry = odometry
        turned = math.remainder(turned, math.tau)
        measured = complex(step_x, step_y) * cmath.rect(1, -(odometry[2] - turned))
        way, metre = abs(measured), beams.metre
        if way > _LARGEST_WAY * metre:
            measured, way = measured * (_LARGEST_WAY * metre) / way, _LARGEST_WAY * metre
        step = measured * cmath.rect(self.moved / self.driven, yaw)
        variance = self.noise * (way**2 + (turned * metre) ** 2)
        variance += (_SCALE_ERROR * way) ** 2 + (_SHIFT * metre) ** 2
        turn_variance = self.noise * ((way / metre) ** 2 + turned**2) + _TURN**2

        # Odometry and command, weighted by their variances.
        share, turn_share = variance / (variance + (_OFF * metre) ** 2), turn_variance / (turn_variance + _TURN**2)
        off = commanded - (x + step.real, y + step.imag, yaw + turned)
        off[2] = math.remainder(off[2], math.tau)
        predicted = commanded - (1 - np.array([share, share, turn_share])) * off
        deviations = math.sqrt((1 - share) * variance), math.sqrt((1 - turn_share) * turn_variance)
        self.pose = best_pose(walls, predicted, *deviations, ranges, beams)

        corrected = complex(self.pose[0] - x, self.pose[1] - y) * cmath.rect(1, -yaw)
        self.error = measured - corrected
        self.driven += (way / metre) ** 2
        self.moved += (measured.conjugate() * corrected).real / metre**2
        self.pose[:2] = np.clip(self.pose[:2], 0.01, len(walls) - 0.01)

    def body(self, observed: MovingBody) -> MovingBody:
        """Returns the body in the grid's frame; its velocities carry the errors of the odometry's last step."""
        x, y, yaw = self.pose.tolist()
        forward, left = observed.forward - self.error.real / STEP_TIME, observed.left - self.error.imag / STEP_TIME
        return MovingBody(observed.model, x, y, yaw, forward, left)


def aligned(size: int, ranges: np.ndarray, beams: Beams) -> np.ndarray:
    """Returns a pose `[3]` in the middle of a grid of `size` cells a side on which nothing was seen.

    Its heading, in [0, pi / 2), lays the scan on the grid's lines.
    """
    walls, poses = seen_walls(np.zeros((size, size))), np.empty((_NUM_HEADINGS, 3))
    poses[:, :2] = size / 2
    poses[:, 2] = np.arange(_NUM_HEADINGS) * (math.pi / 2 / _NUM_HEADINGS)
    best = poses[log_likelihoods(walls, poses, ranges, beams, _DEVIATION * beams.metre).argmax()]
    return best_pose(walls, best, _SHIFT * beams.metre, math.pi / 2 / _NUM_HEADINGS, ranges, beams)


@compiled
def best_pose(
    walls: np.ndarray, predicted: np.ndarray, deviation: float, turn_deviation: float, ranges: np.ndarray, beams: Beams
) -> np.ndarray:
    """Returns the likeliest pose `[3]` of a scan, given a predicted one and its standard deviations (cells, rad)."""
    # Poses around the predicted one, on a smooth likelihood.
    num_turns = 1 + 2 * min(int(2.5 * turn_deviation / 0.07), 6)
    num_shifts = 5 if deviation > _SHIFTED * beams.metre else 1
    starts, scores = np.empty((num_turns * num_shifts, 3)), np.empty(num_turns * num_shifts)
    for t in range(num_turns):
        for s in range(num_shifts):
            start = starts[t * num_shifts + s]
            start[:] = predicted
            start[2] += (t - num_turns // 2) * 0.07
            if s > 0:
                start[s % 2] += 1.3 * deviation * (1 if s > 2 else -1)
            scores[t * num_shifts + s] = _score(
                walls, start, predicted, deviation, turn_deviation, ranges, beams, _FIRST_STEP * beams.metre
            )

    # From the best ones, uphill along one axis after the other, by steps of halving length.
    best, best_score = predicted.copy(), -np.inf
    for _ in range(min(_STARTS, len(scores))):
        k = int(np.argmax(scores))
        scores[k] = -np.inf
        pose, step, score = starts[k].copy(), _FIRST_STEP * beams.metre, -np.inf
        while step > _LAST_STEP * beams.metre:
            smooth = max(step, _DEVIATION * beams.metre)
            score = _score(walls, pose, predicted, deviation, turn_deviation, ranges, beams, smooth)
            for _ in range(_MOST_MOVES):
                before = score
                for axis in range(3):
                    length = step / beams.metre * _TURN_PER_STEP if axis == 2 else step
                    for sign in (-1, 1):
                        pose[axis] += sign * length
                        tried = _score(walls, pose, predicted, deviation, turn_deviation, ranges, beams, smooth)
                        if tried > score:
                            score = tried
                            break
                        pose[axis] -= sign * length
                if score == before:
                    break
            step /= 2
        if score > best_score:
            best, best_score = pose, score
    return best


@inlined
def _score(
    walls: np.ndarray, pose: np.ndarray, predicted: np.ndarray, deviation: float, turn_deviation: float,
    ranges: np.ndarray, beams: Beams, smooth: float,
) -> float:  # fmt: skip
    off = ((pose[0] - predicted[0]) ** 2 + (pose[1] - predicted[1]) ** 2) / deviation**2
    off += ((pose[2] - predicted[2]) / turn_deviation) ** 2
    return _TEMPER * log_likelihood(walls, pose[0], pose[1], pose[2], ranges, beams, smooth) - off / 2
