"""The recall of the poses that an agent reports (docs/metrics.md)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mazebench.results.metrics import RECALLS
from mazebench.tasks.perturbations.perturbation import ShownMap
from mazebench.world.angles import wrap_angle

_NEAR = 1.0  # m
_ALIGNED = math.radians(30)

Hit = tuple[bool, bool]  # whether a reported pose is near the true one, and whether it is aligned, too


def hit(shown: ShownMap, true_pose: np.ndarray, pose: np.ndarray | None) -> Hit | None:
    """Returns how near a reported pose is; None if none is reported, or the map has no frame.

    Args:
      shown: the map that the agent is shown.
      true_pose: `[3]`, x and y (m) and yaw (rad) in the maze.
      pose: `[3]`, the reported one on the shown map.
    """
    expected = None if pose is None else pose_on_map(shown, true_pose)
    if pose is None or expected is None:
        return None
    is_near = math.dist(pose[:2], expected[:2]) <= _NEAR  # not where it is NaN
    return is_near, is_near and abs(wrap_angle(float(pose[2] - expected[2]))) <= _ALIGNED


def recalls(hits: Sequence[Hit | None]) -> dict[str, float]:
    """Returns `RECALLS` by the hits of an episode's steps, of which None is a miss; nothing if there are no others."""
    if all(each is None for each in hits):
        return {}
    found = np.array([each or (False, False) for each in hits], dtype=float)
    shares = [*found.mean(axis=0).tolist(), *found[-1].tolist()]
    return {recall.name: share for recall, share in zip(RECALLS, shares, strict=True)}


def pose_on_map(shown: ShownMap, pose: np.ndarray) -> np.ndarray | None:
    """Returns a pose `[3]` of the maze in the frame of the shown map; None on a map that is bent and has no frame."""
    if shown.drawing is not None and not shown.drawing.is_rigid:
        return None
    x, y, yaw = pose.tolist()
    # The body, and a point ahead of it, whose direction is turned and mirrored as the map is.
    points = np.array([(x, y), (x + math.cos(yaw), y + math.sin(yaw))]) / shown.cell_size
    (x, y), (ahead_x, ahead_y) = (shown.seen_points(points) * shown.cell_size).tolist()
    return np.array([x, y, math.atan2(ahead_y - y, ahead_x - x)])
