"""Features for learners: how much nearer the goal is around the body, by breadth-first search on the shown map.

`B` is the number of environments, `M` the side of a map in pixels, `P` the number of points on a side, `R` of rays.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mazebench.constants import FORWARD_VELOCITY, LEFT_VELOCITY, YAW, YAW_RATE, X, Y
from mazebench.maps.search import search
from mazebench.tasks.context import GLOBAL_MAP, GOAL

_FAR = 6.0  # m; points that are more than this nearer to the goal or farther from it look alike
_NO_WAY = 1e3  # m
_VELOCITY = 3.0  # m/s and rad/s, the order of velocities
_RANGE = 5.0  # m, the order of ranges
_FARTHEST = 40.0  # m, the farthest goals of the tracks
_NUM_OF_BODY = 8  # features of the way left, pose and motion


class DistanceField:
    """The distances to the goal on the maps of B environments, and features of them around the bodies.

    The maps are taken for right, and for lying as the mazes do: where they don't, the features are wrong. Features are
    `[P^2 + 8 + R]` float32, all of an order of 1 and in the body's frame:

    | index | feature |
    |---|---|
    | P^2 | of each point, from behind to ahead, within it from right to left: how much farther the goal is than here |
    | 1 | the way left from here, in 40 m |
    | 2 | the body's offset from the centre of its pixel, ahead and left, in pixels |
    | 2 | cosine and sine of four times the yaw |
    | 3 | velocity ahead and left, yaw rate |
    | R | the lidar's ranges |

    A wall, and what lies outside of the map, counts as far from the goal.
    """

    def __init__(self, num_envs: int, points: int = 5, spacing: float = 1.0, pixel: float = 1.0):
        """The grid around the body has `points` on a side, `spacing` m apart; the maps have pixels of `pixel` m."""
        offsets = spacing * (np.arange(points) - points // 2)
        self._ahead, self._left = (each.ravel() for each in np.meshgrid(offsets, offsets, indexing="ij"))
        self._pixel = pixel
        self._fields: list[np.ndarray] = [np.empty((0, 0))] * num_envs  # of each, [M, M] float32, m of way to the goal

    def num_features(self, num_rays: int) -> int:
        """Returns the number of features with a lidar of so many rays."""
        return len(self._ahead) + _NUM_OF_BODY + num_rays

    def read(self, contexts: np.ndarray, is_new: np.ndarray) -> None:
        """Searches those of the maps of contexts `[B, 4, M, M]` that are new `[B]`; about .1 ms each."""
        for slot in np.flatnonzero(is_new):
            walls = np.pad(contexts[slot, GLOBAL_MAP] > 0.5, 1, constant_values=True)
            side = len(walls)
            row, column = np.unravel_index(contexts[slot, GOAL].argmax(), contexts[slot, GOAL].shape)
            cells, ends = search(walls, int((row + 1) * side + column + 1), -1, side**2)
            distances = np.full(side**2, _NO_WAY, np.float32)
            distances[cells] = self._pixel * np.repeat(np.arange(len(ends)), np.diff(ends, prepend=0))
            self._fields[slot] = distances.reshape(side, side)[1:-1, 1:-1]

    def features(self, observation: Mapping[str, np.ndarray], slots: np.ndarray | None = None) -> np.ndarray:
        """Returns features `[B, P^2 + 8 + R]` of what all environments, or those of `slots`, observe."""
        state = observation["state"].astype(np.float64)
        fields = np.stack(self._fields if slots is None else [self._fields[slot] for slot in slots])
        x, y = state[:, X, None] / self._pixel, state[:, Y, None] / self._pixel
        cos, sin = np.cos(state[:, YAW, None]), np.sin(state[:, YAW, None])
        ahead, left = self._ahead / self._pixel, self._left / self._pixel
        here = _at(fields, x, y)
        farther = _at(fields, x + cos * ahead - sin * left, y + sin * ahead + cos * left) - here
        off_x, off_y = x % 1 - 0.5, y % 1 - 0.5
        pose = [cos * off_x + sin * off_y, cos * off_y - sin * off_x]
        turn = [np.cos(4 * state[:, YAW, None]), np.sin(4 * state[:, YAW, None])]
        motion = state[:, [FORWARD_VELOCITY, LEFT_VELOCITY, YAW_RATE]] / _VELOCITY
        parts = [np.clip(farther / _FAR, -1, 1), np.minimum(here / _FARTHEST, 1), *pose, *turn, motion]
        if "lidar" in observation:
            parts.append(observation["lidar"] / _RANGE)
        return np.concatenate(parts, axis=1, dtype=np.float32)


def _at(fields: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Returns the values `[B, K]` of fields `[B, M, M]` at points in pixels."""
    side = fields.shape[1]
    row, column = side - 1 - np.floor(y).astype(int), np.floor(x).astype(int)
    inside = (row >= 0) & (row < side) & (column >= 0) & (column < side)
    values = fields[np.arange(len(fields))[:, None], row.clip(0, side - 1), column.clip(0, side - 1)]
    return np.where(inside, values, _NO_WAY)
