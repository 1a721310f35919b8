"""Mazes of one's own that are given as values, and mazes as JSON describes them."""

from __future__ import annotations

import collections
import dataclasses
import pathlib
from collections.abc import Iterable, Mapping
from typing import Any

from mazebench.errors import InputError
from mazebench.maps.maze import Maze, resized
from mazebench.maps.maze_options import ReadOptions
from mazebench.maps.readers.arrays import as_array, maze_from_array
from mazebench.maps.text import format_maze, parse_maze


def own_mazes(mazes: Any, options: ReadOptions) -> tuple[Maze, ...]:
    """Returns mazes that are given as values: a maze, an array of any kind that `maze_from_array` takes, or several.

    Mazes that share a name get their index at its end, since results tell mazes by name.

    Raises:
      InputError: if something else is given, or an array is no maze.
    """
    if isinstance(mazes, Maze):
        return (resized(mazes, options.cell_size),)
    if not hasattr(mazes, "__array__"):
        if not isinstance(mazes, Iterable):
            raise InputError(f"expected mazes as values, arrays or a path, found {type(mazes).__name__}")
        if not (mazes := list(mazes)):
            raise InputError("expected at least one maze, found none")
        for item in mazes:
            if isinstance(item, str | pathlib.Path):
                raise InputError(
                    f"expected a Maze or an array in mazes, found {str(item)[:80]!r}; read_maze reads a file"
                )
    if hasattr(mazes, "__array__") or not any(isinstance(item, Maze) or getattr(item, "ndim", 0) > 1 for item in mazes):
        array = as_array(mazes, "mazes")  # lists of rows are an array, too
        if array.ndim != 3 or array.shape[2] in (1, 3, 4):  # a maze, or a picture, which is refused
            return (maze_from_array(array, "maze", **dataclasses.asdict(options)),)
        mazes = list(array)
    found = [
        resized(item, options.cell_size)
        if isinstance(item, Maze)
        else maze_from_array(item, f"maze-{index}", **dataclasses.asdict(options))
        for index, item in enumerate(mazes)
    ]
    times = collections.Counter(maze.name for maze in found)
    return tuple(
        maze if times[maze.name] == 1 else dataclasses.replace(maze, name=f"{maze.name}-{index}")
        for index, maze in enumerate(found)
    )


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
