"""The map that an agent is shown, and the base class of what may be wrong with it or with the observed states."""

from __future__ import annotations

import abc
import dataclasses
import functools
from collections.abc import Callable
from typing import ClassVar

import numpy as np

from mazebench.maps.maze import Cell, Maze
from mazebench.tasks.streams import Stream

# Changes an observed state `[12]` float64 in place. It is called once for each observation of one episode. It is an
# object that can be copied and pickled in the middle of an episode, so a function inside of another one will not do.
StateError = Callable[[np.ndarray], None]


class Drawing(abc.ABC):
    """A drawing of a map of N x N cells: a picture of P x P pixels, in which cells need not lie on a grid."""

    pixels_per_cell: ClassVar[int] = 1  # P / N

    @property
    def is_rigid(self) -> bool:
        """True if the map is only turned or mirrored, with a pixel for each cell."""
        return False

    @abc.abstractmethod
    def picture(self, walls: np.ndarray) -> np.ndarray:
        """Returns `[P, P]`: the picture of `walls` (`[N, N]` bool); bool, or the share of wall in [0, 1] as float32."""

    @abc.abstractmethod
    def pixel(self, cell: Cell, picture: np.ndarray) -> Cell:
        """Returns the pixel (row, column) of `picture` (`[P, P]`, of `picture`) in which a free cell is marked."""

    @abc.abstractmethod
    def points(self, points: np.ndarray, size: int) -> np.ndarray:
        """Returns `[T, 2]` float: where points (x, y) in cells of a maze of `size` cells a side lie in the picture.

        They are counted in pixels, x to the right and y up from the picture's lower left corner.
        """


@dataclasses.dataclass(frozen=True)
class ShownMap:
    """The map that the agent is shown: the true one, or one with wrong cells, or one that is drawn in its own way."""

    walls: np.ndarray  # [N, N] bool, the cells that are shown
    drawing: Drawing | None = None  # None: a pixel for each cell
    hidden: tuple[int, ...] = ()  # planes of the context that the agent is not given: they are zero
    kind: str = ""  # of the true maze, `Maze.kind`
    cell_size: float = 1.0  # m, of the true maze

    @functools.cached_property
    def seen_walls(self) -> np.ndarray:
        """`[P, P]` bool or float32: the walls as the agent sees them; P is N where the map is not drawn."""
        return self.walls if self.drawing is None else self.drawing.picture(self.walls)

    def seen_cell(self, cell: Cell) -> Cell:
        """Returns the pixel of the seen map in which a free cell of the maze is marked."""
        return cell if self.drawing is None else self.drawing.pixel(cell, self.seen_walls)

    def seen_points(self, points: np.ndarray) -> np.ndarray:
        """Returns `[T, 2]` float: where points (x, y) of the maze, in cells, lie on the seen map, in pixels."""
        return points if self.drawing is None else self.drawing.points(points, len(self.walls))


class Perturbation:
    """One thing that may be wrong with what the agent is shown; the world stays true.

    A subclass is a frozen dataclass, whose fields say how wrong it is. It overrides `show`, or `state_error`, or both.
    They get a new generator of `stream`.
    """

    stream: ClassVar[Stream | None] = None  # that no other one draws from; None if nothing is drawn
    hides_pose: ClassVar[bool] = False  # whether the observed pose does not tell where the body is
    pixels_per_cell: ClassVar[int] = 1  # of the shown map, along each axis

    def show(self, shown: ShownMap, ends: tuple[Cell, ...], rng: np.random.Generator) -> ShownMap:
        """Returns the map that the agent is shown instead of `shown`; `ends` are the episode's start and goals."""
        return shown

    def require(self, maze: Maze) -> None:
        """Raises `InputError` if it can't be shown in `maze`."""

    def state_error(self, rng: np.random.Generator) -> StateError | None:
        """Returns what is wrong with the observed states of an episode that begins; None if nothing is."""
        return None
