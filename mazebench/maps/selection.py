"""The mazes that the options of a task name: the benchmark's, or one's own."""

from __future__ import annotations

import pathlib
from collections.abc import Iterable

from mazebench.errors import InputError
from mazebench.maps.benchmark import load_mazes
from mazebench.maps.files import read_mazes
from mazebench.maps.maze import Maze

_DEFAULT_SIZE = 13

# Mazes of one's own: one or several, or the path of a file or of a folder.
Maps = str | pathlib.Path | Maze | Iterable[Maze]


def load_mazes_of(size: int | None = None, split: str = "train", maps: Maps | None = None) -> tuple[Maze, ...]:
    """Returns the mazes of a task.

    Args:
      size: N, the cells on a side of benchmark v1's mazes: 13 (the default), 15, 17, 19 or 21; with `maps`, a size that
        they must have.
      split: "train" or "eval" mazes of benchmark v1; without effect with `maps`.
      maps: mazes of your own instead: a `Maze`, several of one size, or a text or image file or a folder of them.

    Raises:
      InputError: if there are no such mazes, or a map can't be read.
    """
    if maps is None:
        return load_mazes(_DEFAULT_SIZE if size is None else size, split)
    if isinstance(maps, Maze):
        mazes: tuple[Maze, ...] = (maps,)
    else:
        mazes = read_mazes(maps) if isinstance(maps, (str, pathlib.Path)) else tuple(maps)
    for maze in mazes:
        if size not in (None, maze.size):
            raise InputError(f"expected mazes of size {size}, found size {maze.size}")
    return mazes
