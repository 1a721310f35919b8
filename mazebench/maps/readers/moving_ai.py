"""Scenarios of the MovingAI benchmarks: starts and goals on a map, with the lengths of their shortest paths.

`K` is the number of scenarios.
"""

from __future__ import annotations

import pathlib
from typing import NamedTuple

import numpy as np

from mazebench.errors import InputError, remark
from mazebench.maps.readers.occupancy_grid import LocatedMaze
from mazebench.storage.files import read_at_most

_MAX_BYTES = 2**26  # of a .scen file
_NUM_FIELDS = 9


class Scenarios(NamedTuple):
    """The scenarios of a map that can be played in the maze that was read from it."""

    starts: np.ndarray  # [K, 2] int, cells of the maze
    goals: np.ndarray  # [K, 2] int, cells of the maze
    distances: np.ndarray  # [K] int, shortest 4-connected paths in cells
    octile_lengths: np.ndarray  # [K] float, of the file: shortest paths in cells that may also go diagonally


def read_scenarios(path: str | pathlib.Path, located: LocatedMaze) -> Scenarios:
    """Reads a .scen file of the map that `located` was read from.

    A scenario whose start or goal is no free cell of the maze is left out; a `Remark` says how many are.

    Raises:
      InputError: if the file can't be read or is no such file.
    """
    text = read_at_most(path, _MAX_BYTES, "scenarios").decode("utf-8", errors="replace")
    head, *lines = text.splitlines() or [""]
    rows = [line.split() for line in lines if line.strip()]
    if not head.startswith("version 1"):
        raise InputError(f"{path}: expected scenarios of MovingAI, which begin with 'version 1', found {head[:40]!r}")
    for number, row in enumerate(rows):
        if len(row) != _NUM_FIELDS:
            raise InputError(f"{path}: expected {_NUM_FIELDS} fields in a line, found {len(row)} in scenario {number}")
    try:
        ends = np.array([row[3:8] for row in rows], dtype=int).reshape(-1, 5)  # height, start x and y, goal x and y
        octile_lengths = np.array([row[8] for row in rows], dtype=float)
    except ValueError as error:
        raise InputError(f"{path}: expected numbers from the third field on, found {error}") from error

    # From x and y of the map, down from its upper left corner, to cells of the maze.
    maze, (x0, y0, _) = located
    lower = np.rint([y0, x0] / np.array(maze.cell_size)).astype(int)  # cells below and on the left of the maze
    rise = ends[:, 0] - lower[0] - maze.size  # rows of the map above the maze
    starts, goals = (np.stack([ends[:, column + 1] - rise, ends[:, column] - lower[1]], axis=1) for column in (1, 3))

    is_playable = np.array(
        [maze.is_free(start) and maze.is_free(goal) for start, goal in zip(starts, goals, strict=True)]
    )
    if not is_playable.all():
        remark(
            f"{path}: {np.sum(~is_playable)} of {len(rows)} scenarios left out, as an end is a wall or can't be reached"
        )
    starts, goals = starts[is_playable], goals[is_playable]
    distances = [maze.distance(tuple(start), tuple(goal)) for start, goal in zip(starts, goals, strict=True)]
    return Scenarios(starts, goals, np.array(distances, dtype=int), octile_lengths[is_playable])
