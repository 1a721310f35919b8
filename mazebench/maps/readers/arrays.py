"""Mazes from arrays of walls or of occupancy, and from .npy files of them."""

from __future__ import annotations

import dataclasses
import io
import pathlib
from typing import Any

import numpy as np

from mazebench.errors import InputError
from mazebench.maps.file_kinds import kind_of
from mazebench.maps.grids import square_maze
from mazebench.maps.maze import MIN_CELL_SIZE, Maze, MazeError
from mazebench.maps.maze_options import ReadOptions
from mazebench.maps.readers.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid, locate_maze
from mazebench.storage.files import read_at_most

_MAX_BYTES = 2**27  # of a .npy file
_MAX_FREE, _MIN_OCCUPIED = 25, 65  # per cent, of map_saver
_LEAST_PERCENT = 50  # that the largest number of an occupancy grid has; smaller ones are codes of something else


def maze_from_array(array: np.ndarray, name: str = "maze", **options: Any) -> Maze:
    """Returns the maze in an array, whose row 0 is on top.

    Args:
      array: `[R, C]`, either walls as bool or as 0 (free) and 1 (wall), which are padded to a square by `square_maze`;
        or occupancy, -1 where unknown, as 0 (free) and 1 (occupied) or as integers from 0 to 100 per cent, see
        `locate_maze`.
      name: of the maze.
      **options: those of `ReadOptions`.

    Raises:
      InputError: if an option is not allowed.
      MazeError: if the array holds something else, or no legal maze.
    """
    return read_array(np.asarray(array), name, ReadOptions(**options))


def read_array(array: np.ndarray, name: str, options: ReadOptions) -> Maze:
    """Returns the maze in an array, as `maze_from_array` does."""
    if array.ndim != 2 or array.dtype.kind not in "biuf":
        raise MazeError(f"{name}: expected a two-dimensional array of numbers, found shape {array.shape} {array.dtype}")
    cell_size = options.cell_size or 1.0
    if array.dtype == bool or np.isin(array, (0, 1)).all():
        return square_maze(array == 1, name, cell_size)
    is_percent = array.dtype.kind != "f" and array.min() >= UNKNOWN and _LEAST_PERCENT <= array.max() <= OCCUPIED
    is_ternary = np.isin(array, (UNKNOWN, 0, 1)).all()  # as in ROS 2's OccupancyGrid, and in Player's maps
    if not (is_percent or is_ternary):
        found = np.unique(array)
        values = ", ".join(f"{value:g}" for value in found[:6]) + (f", ... {found[-1]:g}" if len(found) > 6 else "")
        raise MazeError(
            f"{name}: expected walls as bool or as 0 and 1, or occupancy as -1, 0 and 1 or as per cent up to 100, "
            f"found {array.dtype} with the values {values}; `array == VALUE` says which are walls"
        )
    if cell_size < MIN_CELL_SIZE:
        raise InputError(
            f"{name}: expected a cell_size of at least {MIN_CELL_SIZE} m, as each element is a cell, "
            f"found {cell_size:g}; save a finer grid as a ROS map, which is coarsened"
        )
    states = np.full(array.shape, UNKNOWN, dtype=np.int8)
    states[(array >= 0) & (array <= (0 if is_ternary else _MAX_FREE))] = FREE
    states[array >= (1 if is_ternary else _MIN_OCCUPIED)] = OCCUPIED
    return locate_maze(OccupancyGrid(states, cell_size), dataclasses.replace(options, cell_size=cell_size), name).maze


def read_array_maze(path: str | pathlib.Path, options: ReadOptions) -> Maze:
    """Reads the maze in a .npy file, as `maze_from_array` does, and names it after the file.

    Raises:
      InputError: if the file can't be read, has more than 128 MiB or is no .npy file of numbers.
      MazeError: if there is no legal maze in it.
    """
    path = pathlib.Path(path)
    content = read_at_most(path, _MAX_BYTES, "map")
    try:
        array = np.lib.format.read_array(io.BytesIO(content), allow_pickle=False)
    except (ValueError, MemoryError) as error:  # of a header that names more numbers than there are
        found = kind_of(content) or "a file of another kind"
        raise InputError(f"{path}: expected a .npy file of numbers, found {found} ({str(error)[:80]})") from error
    return read_array(array, path.stem, options)
