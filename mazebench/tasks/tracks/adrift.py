"""The track `adrift`: doors have moved since the map was drawn, and the pose is odometry."""

from __future__ import annotations

from collections.abc import Sequence

from mazebench.tasks.perturbations.base import Perturbation
from mazebench.tasks.tracks.buildings import BuildingTrack
from mazebench.tasks.tracks.lost import Lost
from mazebench.tasks.tracks.rebuilt import MovedDoors

_BLOCKED = (0.7, 0.7, 0.85)  # share of the shortest paths on the map, by level


class Adrift(BuildingTrack):
    """Doors have moved, and the pose counts from the place and the heading at the first step, as on `lost`."""

    help = "Doors have moved since the map was drawn, and the pose is odometry, which does not tell the place on it."
    levels = (
        "doors have moved: .7 of the paths are blocked; the start is marked, the heading is unknown",
        "the same doors; the start is unknown, too: planes 1 and 3 of the context are zero",
        "doors have moved: .85 of the paths are blocked; the odometry drifts: its scale is off by up to 10 %, its "
        "heading walks by 2 degrees per root second",
    )
    refused_sensors = Lost.refused_sensors
    spare_steps = 150  # so that a lost robot can look for its place

    def parts(self, level: int) -> Sequence[tuple[Perturbation, float]]:
        return (MovedDoors(), _BLOCKED[level - 1]), (Lost(), level)

    def hides_pose(self, level: int) -> bool:
        return True

    def odometry_noise(self, level: int) -> float:
        return (0.01, 0.05, 0.2)[level - 1]
