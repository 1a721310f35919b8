"""Recorders of episodes that run side by side."""

from __future__ import annotations

import collections
from typing import Any, NamedTuple, Protocol

import numpy as np

from mazebench.agent import Observation

_POSE_IN_STATE = (0, 1, 5)  # x, y, yaw


class Recorder(Protocol):
    """Notes what happens in environments, and gives it back when an episode has ended."""

    def add(self, observation: Observation, info: dict[str, Any], actions: np.ndarray, active: np.ndarray) -> None:
        """Notes a step, before it is taken.

        Args:
          observation, info: of all environments, as `MazeVectorEnv` returns them.
          actions: `[B]` int, or `[B, 3]` or `[B, 2]` float for velocities.
          active: `[B]` bool, the environments that have an episode.
        """

    def take(self, slot: int, observation: Observation, info: dict[str, Any]) -> Any:
        """Returns the record of the episode that ended in an environment, and forgets it.

        Args:
          slot: the index of the environment.
          observation: the last one, without the axis B.
          info: the last one of all environments.
        """


class Poses(NamedTuple):
    """The poses of an episode: x and y in metres, yaw in rad."""

    true: np.ndarray  # [L, 3] float32
    observed: np.ndarray  # [L, 3] float32


class PoseRecorder:
    """Records the true and the observed poses."""

    def __init__(self) -> None:
        self._poses: collections.defaultdict[int, list[np.ndarray]] = collections.defaultdict(list)

    def add(self, observation: Observation, info: dict[str, Any], actions: np.ndarray, active: np.ndarray) -> None:
        """Notes the poses before a step."""
        poses = np.column_stack([info["position"], info["yaw"], observation["state"][:, _POSE_IN_STATE]])
        poses = poses.astype(np.float32)
        for slot in np.flatnonzero(active).tolist():
            self._poses[slot].append(poses[slot])

    def take(self, slot: int, observation: Observation, info: dict[str, Any]) -> Poses:
        """Returns the poses of the episode that ended."""
        last = [*info["position"][slot], info["yaw"][slot], *observation["state"][[*_POSE_IN_STATE]]]
        poses = np.stack([*self._poses.pop(slot), np.array(last, dtype=np.float32)])
        return Poses(poses[:, :3], poses[:, 3:])
