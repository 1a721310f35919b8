"""The track `lost`: the observed pose is odometry, whose place and heading on the map are unknown."""

from __future__ import annotations

import dataclasses

import numpy as np

from mazebench.maps.maze import Cell
from mazebench.tasks.context import LOCAL_MAP, START
from mazebench.tasks.odometry import Odometry, corrupted_odometry
from mazebench.tasks.perturbations.base import ShownMap, StateError
from mazebench.tasks.tracks.base import Track


class Lost(Track):
    """The pose is odometry: it counts from the place and the heading at the first step, which the map need not tell."""

    help = "The pose is odometry, which does not tell where on the map the body is."
    stream = 6
    levels = (
        "the start is marked, the heading is unknown",
        "and the start is unknown: planes 1 and 3 of the context are zero",
        "and the odometry drifts: its scale is off by up to 10 %, its heading walks by 2 degrees per root second",
    )
    refused_sensors = ("top", "chase")

    def hides_pose(self, level: int) -> bool:
        return True

    def show(self, shown: ShownMap, level: float, ends: tuple[Cell, Cell], rng: np.random.Generator) -> ShownMap:
        return dataclasses.replace(shown, hidden=(LOCAL_MAP, START)) if level >= 2 else shown

    def state_error(self, level: float, rng: np.random.Generator) -> StateError:
        return corrupted_odometry(rng) if level >= 3 else Odometry(rng)
