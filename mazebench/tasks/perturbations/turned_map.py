"""A map that lies in an unknown way, and a start that is unknown on it."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from mazebench.maps.maze import Cell
from mazebench.tasks.context import LOCAL_MAP, START
from mazebench.tasks.perturbations.perturbation import Drawing, Perturbation, ShownMap
from mazebench.tasks.streams import Stream


@dataclasses.dataclass(frozen=True)
class TurnedMap(Perturbation):
    """Turns the map by 0 to 3 quarters, or mirrors it with probability .5, or both; draws are the same for all."""

    turns: bool = False
    mirrors: bool = False

    stream = Stream.TURNED_SHEET

    def shown(self, shown: ShownMap, ends: tuple[Cell, ...], rng: np.random.Generator) -> ShownMap:
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

    @property
    def is_rigid(self) -> bool:
        return self.inner is None or self.inner.is_rigid

    def picture(self, walls: np.ndarray) -> np.ndarray:
        """Returns `[P, P]`: the inner picture, mirrored and turned."""
        picture = walls if self.inner is None else self.inner.picture(walls)
        return np.ascontiguousarray(np.rot90(picture[:, ::-1] if self.is_mirrored else picture, self.quarters))

    def pixel(self, cell: Cell, picture: np.ndarray) -> Cell:
        if self.inner is not None:
            upright = np.rot90(picture, -self.quarters)
            cell = self.inner.pixel(cell, upright[:, ::-1] if self.is_mirrored else upright)
        x, y = self._turned(cell[1] + 0.5, self.side - cell[0] - 0.5)
        return int(self.side - y), int(x)

    def points(self, points: np.ndarray, size: int) -> np.ndarray:
        drawn = points if self.inner is None else self.inner.points(points, size)
        return np.column_stack(self._turned(*drawn.T))

    def _turned(self, x: Any, y: Any) -> tuple[Any, Any]:
        """Returns where points, x and y in pixels from the lower left corner, are moved to; numbers or arrays."""
        x = self.side - x if self.is_mirrored else x
        for _ in range(self.quarters):
            x, y = self.side - y, x
        return x, y


@dataclasses.dataclass(frozen=True)
class HiddenStart(Perturbation):
    """Gives neither the marker of the start nor the map around it: planes 1 and 3 of the context are zero."""

    def shown(self, shown: ShownMap, ends: tuple[Cell, ...], rng: np.random.Generator) -> ShownMap:
        return dataclasses.replace(shown, hidden=(LOCAL_MAP, START))
