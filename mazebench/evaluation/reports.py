"""The reports of an agent in an episode, and the recall of the poses in them (docs/metrics.md)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from mazebench.results.records import RECALLS
from mazebench.tasks.perturbations.perturbation import ShownMap
from mazebench.world.angles import wrap_angle

_NEAR = 1.0  # m
_ALIGNED = math.radians(30)


class EpisodeReports:
    """What an agent reports in one episode."""

    def __init__(self, shown: ShownMap):
        """Begins an episode with the map that the agent is shown."""
        self._shown = shown
        self._has_poses = False
        self._num_steps, self._num_hits = 0, np.zeros(2)  # hits: near, and also aligned
        self._last, self._notes = np.zeros(2), None

    def add(self, true_pose: np.ndarray, pose: np.ndarray | None, notes: Any) -> None:
        """Takes in the report of a step.

        Args:
          true_pose: `[3]`, x and y (m) and yaw (rad) in the maze, before the step.
          pose: `[3]`, the reported one on the shown map; None if none is reported.
          notes: of the step, a value that JSON can hold.
        """
        self._num_steps, self._last, self._notes = self._num_steps + 1, np.zeros(2), notes
        expected = pose_on_map(self._shown, true_pose)
        if pose is None or expected is None:
            return
        self._has_poses = True
        is_near = math.dist(pose[:2], expected[:2]) <= _NEAR  # not where it is NaN
        is_aligned = abs(wrap_angle(float(pose[2] - expected[2]))) <= _ALIGNED
        self._last = np.array([is_near, is_near and is_aligned], dtype=float)
        self._num_hits += self._last

    def result(self) -> dict[str, Any]:
        """Returns further keys of the episode's record: `RECALLS` if poses were reported, and the last notes."""
        recalls = np.concatenate([self._num_hits / self._num_steps, self._last]).tolist()
        found: dict[str, Any] = dict(zip(RECALLS, recalls, strict=True)) if self._has_poses else {}
        return found if self._notes is None else found | {"notes": self._notes}


def pose_on_map(shown: ShownMap, pose: np.ndarray) -> np.ndarray | None:
    """Returns a pose `[3]` of the maze in the frame of the shown map; None on a map that is bent and has no frame."""
    if shown.drawing is not None and not shown.drawing.is_rigid:
        return None
    x, y, yaw = pose.tolist()
    # The body, and a point ahead of it, whose direction is turned and mirrored as the map is.
    points = np.array([(x, y), (x + math.cos(yaw), y + math.sin(yaw))]) / shown.cell_size
    (x, y), (ahead_x, ahead_y) = (shown.seen_points(points) * shown.cell_size).tolist()
    return np.array([x, y, math.atan2(ahead_y - y, ahead_x - x)])
