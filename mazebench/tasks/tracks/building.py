"""The track `building`: the map is right, but may be turned or mirrored."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from mazebench.maps.maze import Cell
from mazebench.tasks.context import LOCAL_MAP, START
from mazebench.tasks.perturbations.perturbation import Drawing, Perturbation, ShownMap
from mazebench.tasks.streams import Stream
from mazebench.tasks.tracks.track import Track


class Building(Track):
    """Shows the building as it is. The pose is exact in the building's frame, which the map need not show."""

    help = "The map is right, but may be turned or mirrored."
    levels = (
        "the map as drawn",
        "turned by unknown quarter turns; planes 1 and 3 of the context are zero",
        "and mirrored with probability .5",
    )

    def parts(self, level: int) -> Sequence[tuple[Perturbation, float]]:
        turned = TurnedMap(turns=True, mirrors=level == 3)
        return () if level == 1 else ((turned, 1), (HiddenStart(), 1))


@dataclasses.dataclass(frozen=True, eq=False)
class TurnedMap(Perturbation):
    """Turns the map by 0 to 3 quarters, or mirrors it with probability .5, or both; draws are the same for all."""

    turns: bool
    mirrors: bool

    stream = Stream.TURNED_SHEET

    def show(self, shown: ShownMap, level: float, ends: tuple[Cell, Cell], rng: np.random.Generator) -> ShownMap:
        quarters, is_mirrored = int(rng.integers(4)), bool(rng.integers(2))
        side = len(shown.walls) * (1 if shown.drawing is None else shown.drawing.pixels_per_cell)
        turned = _TurnedDrawing(shown.drawing, side, quarters * self.turns, is_mirrored and self.mirrors)
        return dataclasses.replace(shown, drawing=turned)


@dataclasses.dataclass(frozen=True)
class _TurnedDrawing(Drawing):
    """A drawing, or the plain map, that is first mirrored (left to right) and then turned counter-clockwise."""

    inner: Drawing | None
    side: int  # P
    quarters: int  # turns by a quarter
    is_mirrored: bool

    def picture(self, walls: np.ndarray) -> np.ndarray:
        """Returns `[P, P]`: the inner picture, mirrored and turned."""
        picture = walls if self.inner is None else self.inner.picture(walls)
        return np.ascontiguousarray(np.rot90(picture[:, ::-1] if self.is_mirrored else picture, self.quarters))

    def pixel(self, cell: Cell, picture: np.ndarray) -> Cell:
        if self.inner is not None:
            upright = np.rot90(picture, -self.quarters)
            cell = self.inner.pixel(cell, upright[:, ::-1] if self.is_mirrored else upright)
        row, column = cell
        last = self.side - 1
        column = last - column if self.is_mirrored else column
        for _ in range(self.quarters):
            row, column = last - column, row
        return row, column

    def points(self, points: np.ndarray, size: int) -> np.ndarray:
        drawn = points if self.inner is None else self.inner.points(points, size)
        x, y = drawn.T
        x = self.side - x if self.is_mirrored else x
        for _ in range(self.quarters):
            x, y = self.side - y, x
        return np.column_stack([x, y])


class HiddenStart(Perturbation):
    """Gives neither the marker of the start nor the map around it: planes 1 and 3 of the context are zero."""

    stream = Stream.HIDDEN_START

    def show(self, shown: ShownMap, level: float, ends: tuple[Cell, Cell], rng: np.random.Generator) -> ShownMap:
        return dataclasses.replace(shown, hidden=(LOCAL_MAP, START))
