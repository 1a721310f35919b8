"""The map that an agent is shown, and the base class of what may be wrong with it or with the observed states."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from mazebench.maps.homography import warp_cell, warp_points, warp_walls
from mazebench.maps.maze import Cell
from mazebench.options import option

# Changes an observed state `[12]` float64 in place. It is called once for each observation of one episode.
StateError = Callable[[np.ndarray], None]


@dataclasses.dataclass(frozen=True)
class ShownMap:
    """The map that the agent is shown: the true one, or one with wrong cells, or one seen in a wrong perspective."""

    walls: np.ndarray  # [N, N] bool, before the change of perspective
    homography: np.ndarray | None = None  # [3, 3], from cells of `walls` to seen cells; None if they are the same

    def seen_walls(self) -> np.ndarray:
        """Returns `[N, N]` bool: the walls as the agent sees them."""
        return self.walls if self.homography is None else warp_walls(self.walls, self.homography)

    def seen_cell(self, cell: Cell) -> Cell:
        """Returns the cell of the seen map in which the centre of a cell of the maze lies."""
        return cell if self.homography is None else warp_cell(cell, self.homography, len(self.walls))

    def seen_points(self, points: np.ndarray) -> np.ndarray:
        """Returns `[T, 2]` float: where points (x, y) of the maze, in metres, lie on the seen map."""
        if self.homography is None:
            return points
        return warp_points(points, self.homography, len(self.walls))


class Perturbation:
    """One thing that may be wrong with what the agent is shown; the world stays true.

    A level says how wrong it is; at level 0 nothing is. A subclass overrides `show`, or `state_error`, or both.
    """

    help: ClassVar[str]  # what the level means, in one line
    lowest: ClassVar[float] = 0
    highest: ClassVar[float]
    stream: ClassVar[int]  # number of the episode's random stream that it draws from; no other one draws from it

    def show(self, shown: ShownMap, level: float, ends: tuple[Cell, Cell], rng: np.random.Generator) -> ShownMap:
        """Returns the map that the agent is shown instead of `shown`; `ends` are the episode's start and goal."""
        return shown

    def state_error(self, level: float, rng: np.random.Generator) -> StateError | None:
        """Returns what is wrong with the observed states of an episode that begins; None if nothing is."""
        return None


def level(perturbation: Perturbation) -> Any:
    """Returns the dataclass field of the level of `perturbation`, which is kept as `metadata["perturbation"]`."""
    field = option(0.0, perturbation.help, lowest=perturbation.lowest, highest=perturbation.highest)
    return dataclasses.field(default=0.0, metadata={**field.metadata, "perturbation": perturbation})
