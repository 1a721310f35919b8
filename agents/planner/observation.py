"""What the planners read from their observations. The scale of the map is known to them.

Lengths are in cells of the map that the context shows, positions are (x, y) with x to the right and y up.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from mazebench.maps.maze import Cell, path_through_walls

X, Y, YAW, FORWARD_VELOCITY, LEFT_VELOCITY = 0, 1, 5, 6, 7  # indices in the state
GLOBAL_MAP, GOAL, START = 0, 2, 3  # planes of the context
FORWARD, BACKWARD, STRAFE_LEFT, STRAFE_RIGHT, LOOK_LEFT, LOOK_RIGHT = range(6)
TURN_STEP = math.radians(21.12)  # of one look action
COASTING_TIME = 0.125  # s; a body let go at speed v comes to rest after v * COASTING_TIME metres
STEP_TIME = 0.16  # s

Point = tuple[float, float]  # x, y


class Body(NamedTuple):
    """Where a body is, and how it moves in its own frame."""

    x: float
    y: float
    yaw: float  # rad
    forward: float  # cells a second
    left: float  # cells a second

    def coasting(self) -> Point:
        """Returns how far (x, y) the body will still coast if it is let go now."""
        cosine, sine = math.cos(self.yaw), math.sin(self.yaw)
        return (
            COASTING_TIME * (cosine * self.forward - sine * self.left),
            COASTING_TIME * (sine * self.forward + cosine * self.left),
        )

    def velocity(self) -> Point:
        """Returns the velocity (x, y) on the map, in cells a second."""
        x, y = self.coasting()
        return x / COASTING_TIME, y / COASTING_TIME


def observed_body(state: list[float], cells_per_metre: float = 1.0) -> Body:
    """Returns the body as a state `[12]` has it, whose x and y are taken for a place on the map."""
    x, y, forward, left = (cells_per_metre * state[index] for index in (X, Y, FORWARD_VELOCITY, LEFT_VELOCITY))
    return Body(x, y, state[YAW], forward, left)


def marked_cell(plane: np.ndarray) -> Cell:
    """Returns the marked cell of a one-hot plane `[M, M]`."""
    row, column = divmod(int(np.argmax(plane)), plane.shape[1])
    return (row, column)


def start_cell(context: np.ndarray) -> Cell:
    """Returns the start on the map of a context `[4, M, M]`.

    It is the marked cell. If none is marked, it is the free cell nearest to the middle of the map, the first one in
    reading order: of all guesses, the middle is the nearest to the start on average.
    """
    if context[START].any():
        return marked_cell(context[START])
    offset = (np.arange(len(context[START])) - (len(context[START]) - 1) / 2) ** 2
    distance = offset[:, None] + offset
    walls = context[GLOBAL_MAP] > 0.5
    return marked_cell(-distance - distance.max() * 2 * walls)


def plan(context: np.ndarray, start: Cell) -> list[Cell]:
    """Returns a shortest path from `start` to the marked goal on the map of a context `[4, M, M]`."""
    return path_through_walls(context[GLOBAL_MAP] > 0.5, start, marked_cell(context[GOAL]))


def centre(cell: Cell, size: int) -> Point:
    """Returns the centre of a cell."""
    return cell[1] + 0.5, size - cell[0] - 0.5


def cell_of(x: float, y: float, size: int) -> Cell:
    """Returns the cell of a point, or the nearest one if the point lies outside of the map."""
    return _clip(size - 1 - math.floor(y), size), _clip(math.floor(x), size)


def _clip(index: int, size: int) -> int:
    return min(max(index, 0), size - 1)
