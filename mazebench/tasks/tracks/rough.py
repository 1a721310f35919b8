"""The track `rough`: a map as people draw it, of a building in which doors have moved; the pose is odometry."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from mazebench.maps.maze import Cell
from mazebench.tasks.perturbations.perturbation import Perturbation, ShownMap
from mazebench.tasks.streams import Stream
from mazebench.tasks.tracks.adrift import Adrift, lost_pose
from mazebench.tasks.tracks.building import TurnedMap
from mazebench.tasks.tracks.hand_drawing import DISPLACEMENTS, PIXELS, draw_by_hand
from mazebench.tasks.tracks.rebuilt import MovedDoors
from mazebench.tasks.tracks.track import Track

_BLOCKED = (0.45, 0.7, 0.7)  # share of the shortest paths on the map, by level


class Rough(Track):
    """Doors have moved, the map is drawn by hand, and the pose is odometry as on `adrift`."""

    help = "The map is drawn by hand, doors have moved since, and the pose is odometry."
    levels = (
        "bent by up to 0.5 cells, and doors have moved: .45 of the paths are blocked; the start is marked",
        "bent by up to 1 cell, .7 of the paths are blocked; the start is unknown, too",
        "bent by up to 1.5 cells, .7 of the paths are blocked; mirrored with probability .5, and the odometry drifts",
    )
    hides_pose = True
    odometry_noise = Adrift.odometry_noise
    pixels_per_cell = PIXELS

    def parts(self, level: int) -> Sequence[tuple[Perturbation, float]]:
        doors, drawn = (MovedDoors(), _BLOCKED[level - 1]), (HandDrawnMap(), DISPLACEMENTS[level - 1])
        mirrored = ((TurnedMap(turns=False, mirrors=True), 1),) if level == 3 else ()
        return doors, drawn, *mirrored, *lost_pose(level)


class HandDrawnMap(Perturbation):
    """Draws the map by hand, as `draw_by_hand` does; the level is the largest displacement in cells."""

    stream = Stream.DRAWN_SHEET

    def show(self, shown: ShownMap, level: float, ends: tuple[Cell, Cell], rng: np.random.Generator) -> ShownMap:
        return dataclasses.replace(shown, drawing=draw_by_hand(len(shown.walls), level, rng))
