"""The track `rough`: a sheet as people draw it, of a building in which doors have moved; the pose is odometry."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from mazebench.maps.maze import Cell
from mazebench.tasks.perturbations.base import Perturbation, ShownMap
from mazebench.tasks.tracks.adrift import Adrift
from mazebench.tasks.tracks.building import TurnedSheet
from mazebench.tasks.tracks.lost import Lost
from mazebench.tasks.tracks.rebuilt import MovedDoors
from mazebench.tasks.tracks.sketch import DISPLACEMENTS, PIXELS, draw_by_hand

_BLOCKED = (0.45, 0.7, 0.7)  # share of the shortest paths on the map, by level


class Rough(Adrift):
    """Doors have moved, the sheet is drawn by hand as on `sketch`, and the pose is odometry as on `adrift`."""

    help = "The map is drawn by hand, doors have moved since, and the pose is odometry."
    levels = (
        "bent by up to 0.5 cells, and doors have moved: .45 of the paths are blocked; the start is marked",
        "bent by up to 1 cell, .7 of the paths are blocked; the start is unknown, too",
        "bent by up to 1.5 cells, .7 of the paths are blocked; mirrored with probability .5, and the odometry drifts",
    )

    def parts(self, level: int) -> Sequence[tuple[Perturbation, float]]:
        doors, pose = (MovedDoors(), _BLOCKED[level - 1]), (Lost(), level)
        sheet = ((TurnedSheet(turns=False, mirrors=True), 1),) if level == 3 else ()
        return doors, (DrawnSheet(), DISPLACEMENTS[level - 1]), *sheet, pose

    def _context_size(self, level: int, size: int) -> int:
        return PIXELS * size


class DrawnSheet(Perturbation):
    """Draws the map by hand, as `draw_by_hand` does; the level is the largest displacement in cells."""

    help = "The map is drawn by hand."
    stream = 11

    def show(self, shown: ShownMap, level: float, ends: tuple[Cell, Cell], rng: np.random.Generator) -> ShownMap:
        return dataclasses.replace(shown, drawing=draw_by_hand(len(shown.walls), level, rng))
