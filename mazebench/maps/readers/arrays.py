"""Mazes from arrays of walls or of occupancy, and the arrays in .npy and .npz files."""

from __future__ import annotations

import dataclasses
import io
import pathlib
import sys
from typing import Any

import numpy as np

from mazebench.errors import InputError
from mazebench.maps.file_kinds import kind_of
from mazebench.maps.maze import MAX_SIZE, Maze, MazeError
from mazebench.maps.maze_options import ReadOptions
from mazebench.maps.readers.cells import grid_of_characters, grid_of_numbers
from mazebench.maps.readers.occupancy_grid import UNKNOWN, OccupancyGrid, locate_maze
from mazebench.storage.array_files import UNREADABLE, unpack
from mazebench.storage.files import read_at_most

_MAX_SIDE = 4 * MAX_SIZE  # of an array, of which an area is the maze
_MAX_BYTES = 2 * _MAX_SIDE**2  # of a file, and of what an archive unpacks to


def maze_from_array(array: Any, name: str = "maze", **options: Any) -> Maze:
    """Returns the maze in an array, whose row 0 is on top.

        >>> mazebench.maze_from_array(np.array([[0, 0, 0], [1, 1, 0], [0, 0, 0]])).size  # a border is added
        5

    Args:
      array: `[R, C]`: walls as bool or as 0 (free) and 1 (wall); or occupancy, -1 where unknown, as 0 (free) and 1
        (occupied) or as whole numbers from 0 to 100 per cent; or characters as a text map has them. An array that is
        no closed square is made one, see `locate_maze`. What is masked is unknown. Tables of pandas, tensors and lists
        of rows are taken, too.
      name: of the maze.
      **options: those of `ReadOptions`.

    Raises:
      InputError: if an option is not allowed.
      MazeError: if the array holds something else, or no legal maze.
    """
    return locate_maze(grid_of_array(as_array(array, name), name), ReadOptions.of(options), name).maze


def as_array(values: Any, name: str) -> np.ndarray:
    """Returns the array that a table, a tensor or lists of numbers hold, with its mask if it has one.

    Raises:
      MazeError: if there is none.
    """
    try:
        rows = values if isinstance(values, list | tuple) else [values]
        if any(isinstance(row, np.ma.MaskedArray) for row in rows):
            return np.ma.array(values)
        array = np.asarray(values)
        return array if array.dtype != object else np.array(array.tolist())  # as tables of pandas hold other types
    except (TypeError, ValueError, RuntimeError) as error:  # of rows that differ in length, or a tensor on a GPU
        raise MazeError(f"{name}: expected an array, found {type(values).__name__}: {str(error)[:120]}") from error


def read_array_file(path: pathlib.Path) -> OccupancyGrid:
    """Reads the cells in a .npy file, or in a .npz file of one array.

    Raises:
      InputError: if the file can't be read.
      MazeError: if the array is none of `maze_from_array`.
    """
    content = read_at_most(path, _MAX_BYTES, "NumPy array")
    expected = f"{path}: expected a {path.suffix} file of numbers"
    try:
        loaded = np.load(io.BytesIO(content), allow_pickle=False)
        arrays = [loaded] if isinstance(loaded, np.ndarray) else list(unpack(loaded, _MAX_BYTES).values())
    except UNREADABLE as error:  # of a header that lies, too
        found = kind_of(content) or "a file of another kind"
        raise InputError(f"{expected}, found {found} ({str(error)[:80]})") from error
    if len(arrays) != 1:
        raise InputError(f"{expected} with one array, found {len(arrays)}: {', '.join(loaded.files)}; save one as .npy")
    return grid_of_array(arrays[0], path.stem)


def grid_of_array(array: np.ndarray, name: str) -> OccupancyGrid:
    """Returns the cells in an array, as `maze_from_array` takes it.

    Raises:
      MazeError: if the array holds something else.
    """
    if isinstance(array, np.ma.MaskedArray):
        mask, known = np.ma.getmaskarray(array), array.compressed()
        grid = grid_of_array(array.filled(known[0] if len(known) else 0), name)
        return dataclasses.replace(grid, states=np.where(mask, np.int8(UNKNOWN), grid.states))
    if array.ndim == 2 and max(array.shape) > _MAX_SIDE:  # before a square is made of it
        raise MazeError(f"{name}: expected at most {MAX_SIZE} cells a side, found {array.shape[0]} x {array.shape[1]}")
    if array.dtype.kind == "S":
        array = np.char.decode(array, "latin-1")
    if array.dtype.kind == "U" and array.ndim == 2 and array.size and (np.char.str_len(array) == 1).all():
        letters = array.astype("<U1")
        if letters.view(np.uint32).max() <= sys.maxunicode:  # a file may hold any number
            return grid_of_characters(["".join(row) for row in letters], name)
    return grid_of_numbers(array, name)
