"""The shown map seen in a wrong perspective."""

from __future__ import annotations

import dataclasses
from typing import Annotated

import cv2
import numpy as np
from annotated_types import Interval

from mazebench.maps.homography import warp_cell, warp_points, warp_walls
from mazebench.maps.maze import Cell
from mazebench.options import Doc
from mazebench.tasks.perturbations.perturbation import Drawing, Perturbation, ShownMap
from mazebench.tasks.streams import Stream

# If every corner moves by less than this share of the side, the four corners stay a convex quadrilateral.
MAX_WARP = 0.25


WarpShare = Annotated[
    float, Interval(ge=0, le=MAX_WARP), Doc("Largest shift of each corner of the shown map, as a share of its side.")
]


@dataclasses.dataclass(frozen=True)
class MapWarp(Perturbation):
    """Shows the map through a random perspective transform."""

    share: float  # of the side, the largest shift of a corner

    stream = Stream.MAP_WARP

    def show(self, shown: ShownMap, ends: tuple[Cell, Cell], rng: np.random.Generator) -> ShownMap:
        return dataclasses.replace(shown, drawing=Perspective(random_homography(len(shown.walls), self.share, rng)))


@dataclasses.dataclass(frozen=True)
class Perspective(Drawing):
    """A map seen in a wrong perspective, at the resolution of its cells."""

    homography: np.ndarray  # [3, 3], from cells of the map to seen cells

    def picture(self, walls: np.ndarray) -> np.ndarray:
        return warp_walls(walls, self.homography)

    def pixel(self, cell: Cell, picture: np.ndarray) -> Cell:
        return warp_cell(cell, self.homography, len(picture))

    def points(self, points: np.ndarray, size: int) -> np.ndarray:
        return warp_points(points, self.homography, size)


def random_homography(size: int, share: float, rng: np.random.Generator) -> np.ndarray:
    """Returns `[3, 3]` float: a perspective transform that moves each corner of a map at random.

    A corner moves by uniform(-share, share) of the side, in x and in y. Coordinates are (column, row) in cells, with
    the map's corners at 0 and `size`.
    """
    corners = np.array([[0, 0], [size, 0], [size, size], [0, size]], dtype=np.float32)
    moved = corners + size * rng.uniform(-share, share, size=(4, 2)).astype(np.float32)
    return cv2.getPerspectiveTransform(corners, moved)
