"""Records the trajectories of episodes that run side by side."""

from __future__ import annotations

import numpy as np

_POSE_IN_STATE = (0, 1, 5)  # x, y, yaw


class Recorder:
    """The true and the observed poses in each of B environments since its episode began."""

    def __init__(self, num_envs: int):
        self._poses: list[list[np.ndarray]] = [[] for _ in range(num_envs)]

    def add(self, position: np.ndarray, yaw: np.ndarray, state: np.ndarray, active: np.ndarray) -> None:
        """Notes the poses of the environments that are `active`.

        Args:
          position, yaw: the true ones, `[B, 2]` m and `[B]` rad.
          state: the observed states, `[B, 12]`.
          active: `[B]` bool.
        """
        poses = np.column_stack([position, yaw, state[:, _POSE_IN_STATE]]).astype(np.float16)
        for slot in np.flatnonzero(active):
            self._poses[slot].append(poses[slot])

    def take(self, slot: int, position: np.ndarray, yaw: float, state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns the true and the observed poses of the episode that ended in an environment, and forgets them.

        Args:
          slot: the index of the environment.
          position, yaw, state: as in `add`, the last ones of this environment.
        """
        last = np.array([*position, yaw, *state[[*_POSE_IN_STATE]]], dtype=np.float16)
        poses = np.stack([*self._poses[slot], last])
        self._poses[slot] = []
        return poses[:, :3], poses[:, 3:]
