"""What the planners read off their observations, with the scale of the map known to them: one cell is one metre."""

from __future__ import annotations

import math

import numpy as np

from mazebench.maps.maze import Cell, path_through_walls

X, Y, YAW, FORWARD_VELOCITY, LEFT_VELOCITY = 0, 1, 5, 6, 7  # places in the state
GLOBAL_MAP, GOAL, START = 0, 2, 3  # planes of the context
FORWARD, BACKWARD, STRAFE_LEFT, STRAFE_RIGHT, LOOK_LEFT, LOOK_RIGHT = range(6)
TURN_STEP = math.radians(21.12)  # of one look action
COASTING_TIME = 0.125  # s; a body let go at speed v comes to rest after v * COASTING_TIME metres
STEP_TIME = 0.16  # s


def marked_cell(plane: np.ndarray) -> Cell:
    """The marked cell of a `[M, M]` one-hot plane."""
    row, column = divmod(int(np.argmax(plane)), plane.shape[1])
    return (row, column)


def plan(context: np.ndarray, start: Cell | None = None) -> list[Cell]:
    """A shortest path on the map of a `[4, M, M]` context, from `start`, by default the marked one, to the goal."""
    return path_through_walls(
        context[GLOBAL_MAP] > 0.5, start or marked_cell(context[START]), marked_cell(context[GOAL])
    )


def centre(cell: Cell, size: int) -> tuple[float, float]:
    """The centre (x, y) of a cell, in metres."""
    return cell[1] + 0.5, size - cell[0] - 0.5


def cell_of(x: float, y: float, size: int) -> Cell:
    """The cell of a point, moved into the map if it lies outside."""
    return _clip(size - 1 - math.floor(y), size), _clip(math.floor(x), size)


def _clip(index: int, size: int) -> int:
    return min(max(index, 0), size - 1)


def wrap(angle: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


def coasting(state: list[float]) -> tuple[float, float]:
    """How far (x, y) the body will still coast if it is let go now, in metres."""
    cosine, sine = math.cos(state[YAW]), math.sin(state[YAW])
    forward, left = state[FORWARD_VELOCITY], state[LEFT_VELOCITY]
    return COASTING_TIME * (cosine * forward - sine * left), COASTING_TIME * (sine * forward + cosine * left)
