"""Records the trajectories of episodes that run side by side.

`B` is the number of environments.
"""

from __future__ import annotations

import numpy as np

from mazebench.results.trajectories import Trajectory
from mazebench.tasks.context import GLOBAL_MAP, GOAL, START
from mazebench.tasks.episode import Episode
from mazebench.tasks.observation import state_errors
from mazebench.tasks.route import plan_route
from mazebench.tasks.shown_map import show_map
from mazebench.tasks.spec import TaskSpec

_NUM_POSES = 128  # room for a local episode; more is made where it is needed
_POSE_IN_STATE = (0, 1, 5)  # x, y, yaw
_WALL = 255  # of a picture: a pixel of nothing but wall


class Recorder:
    """The poses in each of B environments since its episode began."""

    def __init__(self, task: TaskSpec, num_envs: int):
        self._task = task
        self._poses = np.empty((num_envs, _NUM_POSES, 6), dtype=np.float16)  # the true ones beside the observed ones
        self._count = np.zeros(num_envs, dtype=np.int64)

    def add(self, position: np.ndarray, yaw: np.ndarray, state: np.ndarray, active: np.ndarray) -> None:
        """Notes the poses of the environments that are `active` `[B]`.

        Args:
          position, yaw: the true ones, `[B, 2]` m and `[B]` rad.
          state: the observed states, `[B, 12]`.
          active: whether the environments have an episode.
        """
        if self._count.max() == self._poses.shape[1]:
            self._poses = np.concatenate([self._poses, np.empty_like(self._poses)], axis=1)
        slots = np.arange(len(position))
        self._poses[slots, self._count] = np.column_stack([position, yaw, state[:, _POSE_IN_STATE]])
        self._count += active

    def take(
        self, slot: int, position: np.ndarray, yaw: float, observation: dict[str, np.ndarray], episode: Episode
    ) -> Trajectory:
        """Returns the trajectory of the episode that ended in `slot`, and forgets its poses.

        Args:
          slot: the index of the environment.
          position, yaw: the last true ones, `[2]` m and rad.
          observation: the last one.
          episode: what was played.
        """
        task, context = self._task, observation["context"]
        last = np.array([[*position, yaw, *observation["state"][[*_POSE_IN_STATE]]]], dtype=np.float16)
        poses = np.concatenate([self._poses[slot, : self._count[slot]], last])
        self._count[slot] = 0
        shown = show_map(task, episode)
        cells = plan_route(task, episode, shown).cells[1:]
        landmarks = np.array([row * task.size + column for row, column in cells], dtype=np.int32)
        if task.track is None:
            return Trajectory(poses[:, :3], shown.seen_walls(), landmarks)
        are_cells = shown.drawing is None and task.context_size == task.size
        return Trajectory(
            poses[:, :3],
            shown.walls,
            landmarks,
            marks=np.array([_mark(context[plane]) for plane in (START, GOAL)], dtype=np.int32),
            picture=None if are_cells else np.rint(context[GLOBAL_MAP] * _WALL).astype(np.uint8),
            observed=poses[:, 3:] if state_errors(task, episode) else None,
        )


def _mark(plane: np.ndarray) -> int:
    """Returns which pixel of a plane `[M, M]` of the context is marked, as row * M + column; -1 if none is."""
    return int(plane.argmax()) if plane.any() else -1
