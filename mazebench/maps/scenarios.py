"""Scenarios of the MovingAI benchmarks: starts and goals on a map, with the lengths of their shortest paths.

`K` is the number of scenarios.
"""

from __future__ import annotations

import pathlib
import re
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from mazebench.errors import InputError, remark
from mazebench.maps.maze import Cell, Maze
from mazebench.maps.maze_options import ReadOptions
from mazebench.maps.readers.occupancy_grid import locate_maze
from mazebench.maps.readers.text_map import read_text
from mazebench.storage.files import read_at_most

_SUFFIX = ".scen"
_MAX_BYTES = 2**26
_NUM_FIELDS = 9  # bucket, map, its width and height, x and y of start and goal, length


class Scenarios(NamedTuple):
    """The scenarios of a file that can be played, in its order, and the maze that was read from its map."""

    maze: Maze
    starts: np.ndarray  # [K, 2] int, cells of the maze
    goals: np.ndarray  # [K, 2] int, cells of the maze
    distances: np.ndarray  # [K] int, shortest 4-connected paths in cells, at least 1

    def numbers(self, distances: Iterable[int]) -> np.ndarray:
        """Returns which scenarios have one of some distances: `[...]` int, from 0 to K - 1."""
        return np.flatnonzero(np.isin(self.distances, list(distances)))

    def ends(self, number: int) -> tuple[Cell, Cell]:
        """Returns the start and the goal of a scenario."""
        (start_row, start_column), (goal_row, goal_column) = self.starts[number].tolist(), self.goals[number].tolist()
        return (start_row, start_column), (goal_row, goal_column)


def are_scenarios(mazes: Any) -> bool:
    """Returns whether mazes of one's own are the path of a file of scenarios."""
    return isinstance(mazes, str | pathlib.Path) and pathlib.Path(mazes).suffix.lower() == _SUFFIX


def read_scenarios(path: str | pathlib.Path, options: ReadOptions) -> Scenarios:
    """Reads a .scen file, and its map: the file next to it of the name that it says.

    Scenarios are left out whose start or goal is no free cell of the maze, and those from a cell to itself; a `Remark`
    says how many are.

    Raises:
      InputError: if a file can't be read or is no such file, their sizes differ, or no scenario is left.
    """
    path = pathlib.Path(path).expanduser()
    rows = _read_rows(path)
    try:
        numbers = np.array([row[2:8] for row in rows], dtype=int)
    except (ValueError, OverflowError) as error:
        raise InputError(f"{path}: expected numbers from the third field on, found {error}") from error

    # The map.
    map_path = path.parent / re.split(r"[/\\]", rows[0][1])[-1]
    grid = read_text(map_path)
    height, width = grid.states.shape
    if (other := (numbers[:, :2] != (width, height)).any(axis=1)).any():
        found = " x ".join(map(str, numbers[other.argmax(), :2]))
        raise InputError(f"{path}: expected scenarios of {map_path}, {width} x {height} cells, found {found}")
    maze, (x, y, _) = locate_maze(grid, options, map_path.stem)

    # From x and y of the map, down from its upper left corner, to cells of the maze.
    left, below = (round(metres / maze.cell_size) for metres in (x, y))  # cells of the map beside the maze
    corner = np.array([height - below - maze.size, left])
    starts, goals = numbers[:, [3, 2]] - corner, numbers[:, [5, 4]] - corner

    is_playable = np.array(
        [
            maze.is_free(start) and maze.is_free(goal) and start != goal
            for start, goal in zip(map(tuple, starts.tolist()), map(tuple, goals.tolist()), strict=True)
        ]
    )
    if not is_playable.any():
        raise InputError(f"{path}: expected scenarios in {maze.name}, found none whose ends can be reached")
    if not is_playable.all():
        remark(
            f"{path}: {np.sum(~is_playable)} of {len(rows)} scenarios left out: an end is a wall or can't be reached, "
            "or both are one cell"
        )
    starts, goals = starts[is_playable], goals[is_playable]
    distances = [maze.distance(tuple(start), tuple(goal)) for start, goal in zip(starts, goals, strict=True)]
    return Scenarios(maze, starts, goals, np.array(distances))


def _read_rows(path: pathlib.Path) -> list[list[str]]:
    """Returns the fields of each scenario in a file."""
    text = read_at_most(path, _MAX_BYTES, "scenarios").decode("utf-8", errors="replace")
    head, *lines = text.splitlines() or [""]
    if not head.startswith("version 1"):
        raise InputError(f"{path}: expected scenarios of MovingAI, which begin with 'version 1', found {head[:40]!r}")
    rows = []
    for line in filter(str.strip, lines):
        between_tabs = [field for field in map(str.strip, line.split("\t")) if field]  # a map's name may have blanks
        rows.append(between_tabs if len(between_tabs) == _NUM_FIELDS else line.split())
    for number, row in enumerate(rows):
        if len(row) != _NUM_FIELDS:
            raise InputError(f"{path}: expected {_NUM_FIELDS} fields in a line, found {len(row)} in scenario {number}")
    if len(names := {row[1] for row in rows}) != 1:
        raise InputError(f"{path}: expected scenarios of one map, found {', '.join(sorted(names)) or 'none'}"[:200])
    return rows
