"""Probabilities of walls, start and goal in each cell, as read from a context before the body moves.

A map with a pixel for each cell shows the cells. One with more pixels is registered with the maze as a drawing
(`drawn_map`), from the guess of a network that ships (`bend_network`). Planes that are zero tell nothing.
"""

from __future__ import annotations

import functools
import importlib.util
import pathlib
from collections.abc import Callable
from importlib import resources
from typing import NamedTuple

import numpy as np

from mazebench.agent import Interface
from mazebench.errors import remark
from mazebench.tasks.context import GLOBAL_MAP, GOAL, START

from .cells import marked_cell
from .drawn_map import GUESSED_SIZE, Guess, register, with_border

BENDS = pathlib.Path(str(resources.files("mazebench_assets") / "checkpoints" / "map-bends.safetensors"))

_ERROR = 0.1  # probability that a cell is shown wrong, before anything was seen
_UNKNOWN = 0.2  # probability of a wall where no map is shown; less than walls' share, so that unseen ways are tried


class MapReading(NamedTuple):
    """Three distributions over the cells of a maze of N x N cells."""

    walls: np.ndarray  # [N, N] float, the probability that a cell is a wall; 1 at the border only
    start: np.ndarray  # [N, N] float, the probability that a cell is the start; sums to 1
    goal: np.ndarray  # [N, N] float, the probability that a cell is the goal; sums to 1


def map_reader(interface: Interface) -> pathlib.Path | None:
    """Returns the file of the network by which robots read the maps of an interface.

    None where these are not drawn, or are of other mazes than it learned on; and, with a remark, where PyTorch or the
    file is missing.
    """
    is_drawn = interface.context_size > interface.size and "map" not in interface.hidden
    if not is_drawn or (interface.size, interface.cell_size) != (GUESSED_SIZE, 1.0):
        return None
    missing = [name for name in ("torch", "safetensors") if importlib.util.find_spec(name) is None]
    if missing or not BENDS.is_file():
        lacking = " and ".join(missing) or BENDS.name
        remark(f"without {lacking}, robots read drawn maps less well: no network guesses how they are bent")
        return None
    return BENDS


@functools.cache
def guess_by(path: pathlib.Path) -> Callable[[np.ndarray], Guess]:
    """Returns what guesses how a picture `[62, 62]` is bent: the network of a file.

    Raises:
      InputError: if the file can't be read, or is no such network.
    """
    from .bend_network import load  # which needs PyTorch

    return load(path).read


def read_map(context: np.ndarray, size: int, guess: Callable[[np.ndarray], Guess] | None = None) -> MapReading:
    """Returns what a context `[4, M, M]` tells of a maze of `size` cells a side, at most M.

    With `guess`, the registration of a drawing begins at its guess.
    """
    picture, planes = context[GLOBAL_MAP], context[[START, GOAL]].astype(np.float64)
    if len(picture) > size and picture.any():
        registration = register(picture, size, None if guess is None else guess(picture))
        walls = registration.walls
        possible = 1 - walls
        marks = [registration.marked(marked_cell(plane)) if plane.any() else 1.0 for plane in planes]
    else:
        walls = np.full((size, size), _UNKNOWN)
        if picture.any():
            walls = _ERROR + (1 - 2 * _ERROR) * np.clip(picture.astype(np.float64), 0, 1)
        walls = with_border(walls)
        # Cell (r, c) is marked at (r M // N, c M // N). Marks are right even where the map shows a wall.
        possible = (walls < 1).astype(np.float64)
        pixels = np.ix_(*[np.arange(size) * len(picture) // size] * 2)
        marks = [plane[pixels] if plane.any() else 1.0 for plane in planes]

    # Without any weights, free cells are equally likely.
    weights = [mark * possible for mark in marks]
    start, goal = (each if each.any() else 1 - walls for each in weights)
    return MapReading(walls, start / start.sum(), goal / goal.sum())
