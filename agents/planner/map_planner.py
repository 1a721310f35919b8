"""What the planners on a map have in common: they know its scale."""

from __future__ import annotations

import pathlib
from typing import Self

from mazebench.agent import Agent, Interface


class MapPlanner(Agent):
    """The base of agents that plan on the cells of the shown map."""

    def __init__(self, cells_per_metre: float = 1.0):
        self._cells_per_metre = cells_per_metre  # of the map that the context shows

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> Self:
        """Returns a planner for the scale of the map, which follows from M, N and the size of a cell."""
        return cls(interface.context_size / (interface.size * interface.cell_size))

    @classmethod
    def context_size(cls, size: int) -> int:
        """Returns N: the map at full resolution, whose cells are waypoints."""
        return size
