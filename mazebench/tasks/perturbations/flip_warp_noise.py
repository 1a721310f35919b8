"""The paper's perturbations: flipped cells, a wrong perspective, and noise on the observed position."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from typing import Annotated

import cv2
import numpy as np
from annotated_types import Interval

from mazebench.maps.maze import Cell
from mazebench.options import Doc
from mazebench.tasks.perturbations.perturbation import Drawing, Of, Perturbation, ShownMap, StateError
from mazebench.tasks.streams import Stream

# If every corner moves by less than this share of the side, the four corners stay a convex quadrilateral.
MAX_WARP = 0.25

# The options that are their strengths.
FlipShare = Annotated[
    float,
    Interval(ge=0, le=1),
    Doc("Probability of each inner cell of the shown map, except start and goal, to be flipped."),
]
WarpShare = Annotated[
    float, Interval(ge=0, le=MAX_WARP), Doc("Largest shift of each corner of the shown map, as a share of its side.")
]
PositionDeviation = Annotated[
    float,
    Interval(ge=0, le=1000),  # more would be a mistake
    Doc("Standard deviation of the noise on x and y of each observation, in metres."),
]


@dataclasses.dataclass(frozen=True)
class MapFlip(Perturbation):
    """Shows free cells as walls and walls as free cells."""

    probability: float  # of each inner cell but start and goal

    stream = Stream.MAP_FLIP

    def shown(self, shown: ShownMap, ends: tuple[Cell, ...], rng: np.random.Generator) -> ShownMap:
        flipped = rng.random(shown.walls.shape) < self.probability
        flipped[[0, -1]] = flipped[:, [0, -1]] = False
        for cell in ends:
            flipped[cell] = False
        return dataclasses.replace(shown, walls=shown.walls ^ flipped)


@dataclasses.dataclass(frozen=True)
class MapWarp(Perturbation):
    """Shows the map through a random perspective transform."""

    share: float  # of the side, the largest shift of a corner in x and in y

    stream = Stream.MAP_WARP

    def shown(self, shown: ShownMap, ends: tuple[Cell, ...], rng: np.random.Generator) -> ShownMap:
        return dataclasses.replace(shown, drawing=Perspective(random_homography(len(shown.walls), self.share, rng)))


@dataclasses.dataclass(frozen=True)
class Perspective(Drawing):
    """A map seen in a wrong perspective, at the resolution of its cells; what was outside of the map is wall."""

    homography: np.ndarray  # [3, 3], from (column, row) in cells, with the map's corners at 0 and N, to seen cells

    def picture(self, walls: np.ndarray) -> np.ndarray:
        # OpenCV puts the centre of the first pixel at 0, this package at 0.5.
        shift = np.array([[1, 0, 0.5], [0, 1, 0.5], [0, 0, 1]])
        warped = cv2.warpPerspective(
            walls.astype(np.uint8),
            np.linalg.inv(shift) @ self.homography @ shift,
            walls.shape[::-1],
            flags=cv2.INTER_NEAREST,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=1,
        )
        return warped.astype(bool)

    def pixel(self, cell: Cell, picture: np.ndarray) -> Cell:
        """Returns the cell in which the centre of `cell` lies, or the nearest one if it has left the map."""
        column, row, scale = self.homography @ (cell[1] + 0.5, cell[0] + 0.5, 1.0)
        row, column = np.clip(np.floor((row / scale, column / scale)), 0, len(picture) - 1).astype(int)
        return (int(row), int(column))

    def points(self, points: np.ndarray, size: int) -> np.ndarray:
        rows = np.column_stack([points[:, 0], size - points[:, 1], np.ones(len(points))]) @ self.homography.T
        return np.column_stack([rows[:, 0] / rows[:, 2], size - rows[:, 1] / rows[:, 2]])


def random_homography(size: int, share: float, rng: np.random.Generator) -> np.ndarray:
    """Returns `[3, 3]` float: a perspective transform that moves each corner of a map at random.

    A corner moves by uniform(-share, share) of the side, in x and in y. Coordinates are (column, row) in cells, with
    the map's corners at 0 and `size`.
    """
    corners = np.array([[0, 0], [size, 0], [size, size], [0, size]], dtype=np.float32)
    moved = corners + size * rng.uniform(-share, share, size=(4, 2)).astype(np.float32)
    return cv2.getPerspectiveTransform(corners, moved)


@dataclasses.dataclass(frozen=True)
class PositionNoise(Perturbation):
    """Adds normal noise to x and y of each observed state, independent from one observation to the next."""

    deviation: float  # m, the standard deviation in x and in y

    of = Of.SENSES
    stream = Stream.POSITION_NOISE

    def observed(self, rng: np.random.Generator) -> StateError:
        return functools.partial(_add_noise, self.deviation, rng)


def _add_noise(deviation: float, rng: np.random.Generator, state: np.ndarray) -> None:
    state[:2] += rng.normal(0.0, deviation, size=2)


# By the option that has the strength. They are applied in this order, and strength 0 switches one off.
PERTURBATIONS: dict[str, Callable[[float], Perturbation]] = {
    "map_flip": MapFlip,
    "map_warp": MapWarp,
    "position_noise": PositionNoise,
}
