"""The mazes that the options of a task name: the benchmark's, or one's own."""

from __future__ import annotations

import pathlib
from collections.abc import Iterable

import numpy as np

from mazebench.errors import InputError
from mazebench.maps.benchmark import load_mazes
from mazebench.maps.drawn import FreshMazes, Mazes, draw_mazes
from mazebench.maps.maze import Maze, resized
from mazebench.maps.maze_files import read_all
from mazebench.maps.maze_options import MazeOptions, ReadOptions
from mazebench.maps.readers.arrays import read_array

_NUM_MAZES = 20  # of a kind, unless another number is asked for

# Mazes of one's own: one or several, as values or arrays, or the path of a file or of a folder.
OwnMazes = str | pathlib.Path | Maze | np.ndarray | Iterable[Maze | np.ndarray]


def load_mazes_of(options: MazeOptions, default_size: int = 13) -> Mazes:
    """Returns the mazes that options name, but for those of tracks.

    Args:
      options: `size` is N, the cells on a side of the benchmark's mazes: 13 (the default), 15, 17, 19 or 21; with
        `mazes`, a size that they must have. `split` names mazes of the benchmark. `mazes` are your own instead: a
        `Maze`, an array as `maze_from_array` takes it, several of these of one size, or the path of a file or of a
        folder of files. With `kinds`, `num_mazes` or `fresh`, mazes are drawn, of any N that the kinds can make: those
        of the split "train", or others, "dev".
      default_size: N, unless options name it.

    Raises:
      InputError: if there are no such mazes, or a map can't be read.
    """
    size = options.size
    if options.mazes is None:
        size = default_size if size is None else size
        if options.fresh:
            return FreshMazes(options.drawn_kinds, size)
        if options.is_drawn:
            split = "train" if options.split == "train" else "dev"
            return draw_mazes(options.drawn_kinds, size, split, options.num_mazes or _NUM_MAZES)
        return load_mazes(size, options.split)
    mazes = _own_mazes(options.mazes, options)
    for maze in mazes:
        if size not in (None, maze.size):
            raise InputError(f"expected mazes of size {size}, found size {maze.size}")
    return mazes


def _own_mazes(mazes: OwnMazes, options: ReadOptions) -> tuple[Maze, ...]:
    if isinstance(mazes, (str, pathlib.Path)):
        return read_all(pathlib.Path(mazes), options)
    if isinstance(mazes, Maze) or (isinstance(mazes, np.ndarray) and mazes.ndim < 3):
        return (_own_maze(mazes, "maze", options),)
    if not isinstance(mazes, Iterable):
        raise InputError(f"expected mazes as values, arrays or a path, found {type(mazes).__name__}")
    return tuple(_own_maze(item, f"maze-{index}", options) for index, item in enumerate(mazes))


def _own_maze(item: object, name: str, options: ReadOptions) -> Maze:
    if isinstance(item, np.ndarray):
        return read_array(item, name, options)
    if not isinstance(item, Maze):
        hint = "; wrap rows of numbers in np.array" if isinstance(item, list) else ""
        raise InputError(f"expected a Maze or an array in mazes, found {type(item).__name__}{hint}")
    return resized(item, options.cell_size)
