"""Mazes of one's own that are given as values, and mazes as JSON describes them."""

from __future__ import annotations

import collections
import dataclasses
import pathlib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from mazebench.errors import InputError
from mazebench.maps.maze import Maze, resized
from mazebench.maps.maze_options import ReadOptions
from mazebench.maps.older_map import OlderMap, lay_on, one_for_each
from mazebench.maps.pair import pair_of_walls
from mazebench.maps.readers.arrays import as_array, grid_of_array
from mazebench.maps.readers.occupancy_grid import LocatedMaze, OccupancyGrid, locate_maze
from mazebench.maps.text import format_maze, format_walls, parse_maze, parse_walls


def own_mazes(mazes: Any, options: ReadOptions) -> tuple[Maze, ...]:
    """Returns mazes that are given as values: a maze, an array of any kind that `maze_from_array` takes, or several.

    Mazes that share a name get their index at its end, since results tell mazes by name.

    Raises:
      InputError: if something else is given, or an array is no maze.
    """
    found = [_located(item, name, options).maze for item, name in _items(mazes)]
    times = collections.Counter(maze.name for maze in found)
    return tuple(
        maze if times[maze.name] == 1 else dataclasses.replace(maze, name=f"{maze.name}-{index}")
        for index, maze in enumerate(found)
    )


def texts_of(shown: Any, mazes: Any, options: ReadOptions, is_aligned: bool) -> tuple[str, ...]:
    """Returns older maps of mazes in the cells of the mazes, as texts, which `maps_in_texts` takes.

    Both are given as `own_mazes` takes them; a single map is that of all mazes. Such texts stay as they are. Maps are
    laid on the mazes as `lay_on` does.

    Raises:
      InputError: if something else is given, there are other numbers of them, or one is no older map of its maze.
    """
    if isinstance(shown, tuple | list) and all(isinstance(each, str) and "\n" in each for each in shown):
        return tuple(shown)
    newer, older = _items(mazes), [(item, f"shown {name}") for item, name in _items(shown)]
    return tuple(
        format_walls(
            lay_on(_grid(old, name), _grid(new, of), _located(new, of, options), options, name, is_aligned).walls
        )
        for (new, of), (old, name) in zip(newer, one_for_each(older, len(newer)), strict=True)
    )


def maps_in_texts(texts: Sequence[str], mazes: Sequence[Maze]) -> tuple[OlderMap, ...]:
    """Returns the older maps of mazes that `texts_of` returned as text.

    Raises:
      InputError: if they are others.
    """
    walls = [parse_walls(text, "shown") for text in texts]
    if [each.shape for each in walls] != [maze.walls.shape for maze in mazes]:
        raise InputError("expected an older map in the cells of each maze, found others")
    return tuple(
        OlderMap(each, maze, pair_of_walls(each, maze.walls, maze.cell_size))
        for each, maze in zip(walls, mazes, strict=True)
    )


def _grid(item: Any, name: str) -> OccupancyGrid:
    """Returns the cells of a maze or an array."""
    return grid_of_array(item.walls if isinstance(item, Maze) else as_array(item, name), name)


def _located(item: Any, name: str, options: ReadOptions) -> LocatedMaze:
    """Returns a maze, or that in an array and its place there."""
    if isinstance(item, Maze):
        return LocatedMaze(resized(item, options.cell_size))
    return locate_maze(_grid(item, name), options, name)


def _items(mazes: Any) -> list[tuple[Any, str]]:
    """Returns mazes and arrays with their names.

    Raises:
      InputError: if something else is given.
    """
    if isinstance(mazes, Maze):
        return [(mazes, mazes.name)]
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
            return [(array, "maze")]
        mazes = list(array)
    return [(item, item.name if isinstance(item, Maze) else f"maze-{index}") for index, item in enumerate(mazes)]


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
