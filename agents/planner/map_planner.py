"""The base of the planners on a map: they know its scale, and plan shortest paths on it."""

from __future__ import annotations

import pathlib
from typing import Self

import numpy as np

from mazebench.agent import Agent, Interface
from mazebench.maps.maze import Cell, path_through_walls
from mazebench.tasks.context import GLOBAL_MAP, GOAL

from ..robot.cells import marked_cell


class MapPlanner(Agent):
    """The base of agents that plan on the cells of the shown map."""

    needs_shown = ("map", "goal")

    def __init__(self, cells_per_metre: float = 1.0, kind: str = "six"):
        self._cells_per_metre = cells_per_metre  # of the map that the context shows
        self._kind = kind  # of actions

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> Self:
        """Returns a planner for the scale of the map, which follows from M, N and the size of a cell."""
        return cls(interface.context_size / (interface.size * interface.cell_size), interface.actions)

    @classmethod
    def context_size(cls, size: int) -> int:
        """Returns N: the map at full resolution, whose cells are waypoints."""
        return size


def plan(context: np.ndarray, start: Cell) -> list[Cell]:
    """Returns a shortest path from `start` to the marked goal on the map of a context `[4, M, M]`."""
    return path_through_walls(context[GLOBAL_MAP] > 0.5, start, marked_cell(context[GOAL]))
