"""Cells of the shown map that are flipped."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from typing import Annotated

import numpy as np
from annotated_types import Interval

from mazebench.maps.maze import Cell
from mazebench.options import Doc
from mazebench.tasks.perturbations.perturbation import Perturbation, ShownMap
from mazebench.tasks.streams import Stream

FlipShare = Annotated[
    float,
    Interval(ge=0, le=1),
    Doc("Probability of each inner cell of the shown map, except start and goal, to be flipped."),
]


@dataclasses.dataclass(frozen=True)
class MapFlip(Perturbation):
    """Shows free cells as walls and walls as free cells."""

    probability: float

    stream = Stream.MAP_FLIP

    def show(self, shown: ShownMap, ends: tuple[Cell, Cell], rng: np.random.Generator) -> ShownMap:
        return dataclasses.replace(shown, walls=flip(shown.walls, self.probability, ends, rng))


def flip(walls: np.ndarray, probability: float, keep: Iterable[Cell], rng: np.random.Generator) -> np.ndarray:
    """Returns `[N, N]` bool: `walls` with each inner cell flipped with `probability`, except the cells to `keep`."""
    flipped = rng.random(walls.shape) < probability
    flipped[[0, -1]] = flipped[:, [0, -1]] = False
    for cell in keep:
        flipped[cell] = False
    return walls ^ flipped
