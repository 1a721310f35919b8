"""The map that an agent is shown, and the base of perturbations: of that map, of the building, or of the senses."""

from __future__ import annotations

import abc
import dataclasses
import enum
import functools
from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar

import numpy as np

from mazebench.maps.maze import Cell, Maze
from mazebench.tasks.schedule import DoorTimes
from mazebench.tasks.streams import Stream

# Changes an observed state `[12]` float64 in place. It is called once for each observation of one episode. It is an
# object that can be copied and pickled in the middle of an episode, so a function inside of another one will not do.
StateError = Callable[[np.ndarray], None]

# Returns the index of the task's maze that stands after an agent step (1 is the first) that left the body in a cell of
# the maze with an index. It is called once for each step of one episode, and is an object that can be copied likewise.
Standing = Callable[[int, int, Cell], int]


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


class Of(enum.Enum):
    """The thing that a perturbation is of."""

    MAP = enum.auto()  # how it is drawn
    BUILDING = enum.auto()  # in what it differs from its map; an older map of a user's own tells it instead
    DOORS = enum.auto()  # which of the building's close and open while one drives
    SENSES = enum.auto()  # the observed states; the option `exact_pose` leaves it out


class Perturbation:
    """One thing in which the map, the building and the observed states differ.

    A subclass is a frozen dataclass, whose fields say how much. It says what it is `of` and overrides one method or
    several, each of which gets a new generator of random numbers:

    - `shown`: the map that is shown, in a maze that is the true building. Called once an episode.
    - `building`: the true building, of a maze of a user's own that is its plan. Called when the mazes are read.
    - `standing`: the maze that stands after each step, for a building that changes. Called once an episode.
    - `times`: when doors close and open in an episode. Called once an episode.
    - `observed`: the error of the observed states. Called once an episode.
    """

    of: ClassVar[Of] = Of.MAP
    stream: ClassVar[Stream | None] = None  # of an episode, that no other one draws from; None if nothing is drawn
    option: ClassVar[str | None] = None  # of the task, whose value stands in the place of a track's
    hides_pose: ClassVar[bool] = False  # whether the observed pose does not tell where the body is
    pixels_per_cell: ClassVar[int] = 1  # of the shown map, along each axis

    def shown(self, shown: ShownMap, ends: tuple[Cell, ...], rng: np.random.Generator) -> ShownMap:
        """Returns the map that the agent is shown instead of `shown`; `ends` are the episode's start and goals."""
        return shown

    def building(self, plan: Maze, rng: np.random.Generator) -> Maze:
        """Returns a true building of which `plan` is the map, with its cells and their size.

        Raises:
          InputError: if the plan can't be changed so.
        """
        return plan

    def standing(self, rng: np.random.Generator) -> Standing | None:
        """Returns what tells the maze after each step of an episode that begins; None if it stays.

        All mazes of a task have one size. A wall must not come to stand where the body is.
        """
        return None

    def times(self, maze: Maze, ends: Sequence[Cell], rng: np.random.Generator) -> dict[int, DoorTimes]:
        """Returns the times of the doors that move, by their numbers among `moving_doors` of the maze; here none.

        `ends` are the episode's start and goals.
        """
        return {}

    def observed(self, rng: np.random.Generator) -> StateError | None:
        """Returns what is wrong with the observed states of an episode that begins; None if nothing is."""
        return None

    def require(self, maze: Maze) -> None:
        """Raises `InputError` if it can't be shown in `maze`, which is the true building."""

    def told(self) -> Mapping[str, float]:
        """Returns what agents may know of it: values of fields of `Interface`, of several levels the largest."""
        return {}
