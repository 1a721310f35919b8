"""Mazes of one's own that are given as values, and mazes as JSON describes them."""

from __future__ import annotations

import collections
import dataclasses
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from mazebench.errors import InputError
from mazebench.maps.maze import Maze, resized
from mazebench.maps.maze_options import ReadOptions
from mazebench.maps.readers.arrays import maze_from_array
from mazebench.maps.text import format_maze, parse_maze


def own_mazes(mazes: Any, options: ReadOptions) -> tuple[Maze, ...]:
    """Returns mazes that are given as values: a maze, an array, or several of these.

    Mazes that share a name get their index at its end, since results tell mazes by name.

    Raises:
      InputError: if something else is given, or an array is no maze.
    """
    if isinstance(mazes, Maze) or (isinstance(mazes, np.ndarray) and mazes.ndim < 3):
        return (_own_maze(mazes, "maze", options),)
    if not isinstance(mazes, Iterable):
        raise InputError(f"expected mazes as values, arrays or a path, found {type(mazes).__name__}")
    found = [_own_maze(item, f"maze-{index}", options) for index, item in enumerate(mazes)]
    times = collections.Counter(maze.name for maze in found)
    return tuple(
        maze if times[maze.name] == 1 else dataclasses.replace(maze, name=f"{maze.name}-{index}")
        for index, maze in enumerate(found)
    )


def _own_maze(item: object, name: str, options: ReadOptions) -> Maze:
    if isinstance(item, np.ndarray):
        return maze_from_array(item, name, **dataclasses.asdict(options))
    if not isinstance(item, Maze):
        hint = "; wrap rows of numbers in np.array" if isinstance(item, list) else ""
        raise InputError(f"expected a Maze or an array in mazes, found {type(item).__name__}{hint}")
    return resized(item, options.cell_size)


def described_maze(maze: Maze) -> dict[str, Any]:
    """Returns a maze in values that JSON has."""
    return {"name": maze.name, "rows": format_maze(maze).splitlines(), "cell_size": maze.cell_size, "kind": maze.kind}


def maze_as_described(described: Mapping[str, Any]) -> Maze:
    """Returns the maze that `described_maze` described.

    Raises:
      InputError: if the description is no such one, or of no legal maze.
    """
    if described.keys() != {"name", "rows", "cell_size", "kind"}:
        raise InputError(f"expected a maze with name, rows, cell_size and kind, found {', '.join(map(str, described))}")
    maze = parse_maze("\n".join(described["rows"]), described["name"])
    return dataclasses.replace(maze, cell_size=described["cell_size"], kind=described["kind"])
