"""The track `adrift`: doors have moved since the map was drawn, and the pose is odometry."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mazebench.tasks.odometry import Odometry, corrupted_odometry
from mazebench.tasks.perturbations.perturbation import Perturbation, StateError
from mazebench.tasks.streams import Stream
from mazebench.tasks.tracks.building import HiddenStart
from mazebench.tasks.tracks.rebuilt import MovedDoors
from mazebench.tasks.tracks.track import Track

_BLOCKED = (0.7, 0.7, 0.85)  # share of the shortest paths on the map, by level


class Adrift(Track):
    """Doors have moved, and the pose counts from the place and the heading at the first step."""

    help = "Doors have moved since the map was drawn, and the pose is odometry, which does not tell the place on it."
    levels = (
        "doors have moved: .7 of the paths are blocked; the start is marked, the heading is unknown",
        "the same doors; the start is unknown, too: planes 1 and 3 of the context are zero",
        "doors have moved: .85 of the paths are blocked; the odometry drifts: its scale is off by up to 10 %, its "
        "heading walks by 2 degrees per root second",
    )
    hides_pose = True
    odometry_noise = (0.01, 0.05, 0.2)

    def parts(self, level: int) -> Sequence[tuple[Perturbation, float]]:
        return (MovedDoors(), _BLOCKED[level - 1]), *lost_pose(level)


def lost_pose(level: int) -> Sequence[tuple[Perturbation, float]]:
    """Returns what is wrong with the pose at a level; from level 2 on the start is unknown, at level 3 it drifts."""
    return (LostPose(), level), *(((HiddenStart(), 1),) if level >= 2 else ())


class LostPose(Perturbation):
    """Counts the observed pose from the place and the heading at the first step; from level 3 on it drifts."""

    stream = Stream.LOST_POSE

    def state_error(self, level: float, rng: np.random.Generator) -> StateError:
        return corrupted_odometry(rng) if level >= 3 else Odometry(rng)
