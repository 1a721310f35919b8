"""Mazes in files: one text, picture, array or ROS map, or a folder of them."""

from __future__ import annotations

import pathlib
from typing import Any

import numpy as np

from mazebench.errors import InputError, remark
from mazebench.maps.maze import Maze, resized
from mazebench.maps.maze_options import ReadOptions
from mazebench.maps.readers.arrays import read_array_maze
from mazebench.maps.readers.image import read_image_maze
from mazebench.maps.readers.occupancy_grid import LocatedMaze
from mazebench.maps.readers.ros import (
    ROS_SUFFIXES,
    is_other_yaml,
    locate_floor_plan,
    locate_ros_maze,
    map_of_picture,
    picture_of,
)
from mazebench.maps.text import read_text_maze

IMAGE_SUFFIXES = (
    *(".png", ".jpg", ".jpeg", ".bmp", ".pgm", ".ppm", ".pbm", ".pnm"),
    *(".tif", ".tiff", ".webp", ".gif"),
)
TEXT_SUFFIXES = (".txt", ".map")
ARRAY_SUFFIXES = (".npy",)
# In the order in which they are read if a folder holds one map in several: those come first that say the cells' size.
SUFFIXES = (*ROS_SUFFIXES, *TEXT_SUFFIXES, *ARRAY_SUFFIXES, *IMAGE_SUFFIXES)
# What is recognised and not read, and the way out.
_AS_PICTURE, _AS_TEXT = "save it as a PNG", "save it as a text map or as .npy"
_CONVERTED = {
    **dict.fromkeys((".avif", ".heic", ".heif", ".svg", ".pdf", ".dxf", ".dwg"), _AS_PICTURE),
    **dict.fromkeys((".npz", ".csv", ".tsv", ".json", ".mat"), _AS_TEXT),
}
# Of a floor plan that is read as a picture of cells: cells a side, and the free share of them. Mazes have more walls.
_MANY_CELLS, _MOSTLY_FREE = 100, 0.8


def read_maze(path: str | pathlib.Path, size: int | None = None, **options: Any) -> Maze:
    """Reads the maze in one file: a ROS map, an array or a picture if the suffix says so, else text.

    Args:
      path: of the file; of a ROS map, of its YAML file.
      size: N that the maze must have; for a picture whose cells can't be counted, the cells on its longer side.
      **options: those of `mazebench.maps.maze_options.ReadOptions`.

    Raises:
      InputError: if the file can't be read or holds no legal maze.
    """
    return read_located(pathlib.Path(path).expanduser(), size, ReadOptions(**options)).maze


def read_mazes(path: str | pathlib.Path, **options: Any) -> tuple[Maze, ...]:
    """Reads the maze in a file, or the mazes in a folder's map files in the order of their names.

    If a folder holds one map in several formats, as `mazebench generate` writes them, one of them is read: the first of
    ROS map, text, array, picture.

    Args:
      path: of the file or folder.
      **options: those of `mazebench.maps.maze_options.ReadOptions`.

    Raises:
      InputError: if there is no map or one can't be read.
    """
    return read_all(pathlib.Path(path).expanduser(), ReadOptions(**options))


def read_all(path: pathlib.Path, options: ReadOptions) -> tuple[Maze, ...]:
    """Reads the maze in a file, or those in a folder, as `read_mazes` does."""
    if not path.is_dir():
        return (read_located(path, None, options).maze,)
    return tuple(read_located(file, None, options).maze for file in _map_files(path))


def read_located(path: pathlib.Path, size: int | None, options: ReadOptions) -> LocatedMaze:
    """Reads the maze in one file, as `read_maze` does, and its place in the frame of a ROS map."""
    suffix = path.suffix.lower()
    if suffix in _CONVERTED:
        raise InputError(f"{path}: expected a map ({' '.join(SUFFIXES)}), found {suffix}; {_CONVERTED[suffix]}")
    if suffix in IMAGE_SUFFIXES and (ros_map := map_of_picture(path)) is not None:
        raise InputError(f"{path}: expected a maze, found the picture of a ROS map; give {ros_map}")
    if suffix in ROS_SUFFIXES:
        located = locate_ros_maze(path, options)
    elif suffix in ARRAY_SUFFIXES:
        located = LocatedMaze(read_array_maze(path, options))
    elif suffix not in IMAGE_SUFFIXES:
        located = LocatedMaze(resized(read_text_maze(path), options.cell_size))
    elif options.pixel_size is not None:
        located = locate_floor_plan(path, options.pixel_size, options)
    else:
        maze = read_image_maze(path, size, options.walls)
        if not options.cell_size:
            _remark_on_thin_walls(maze)
        located = LocatedMaze(resized(maze, options.cell_size))
    if size not in (None, located.maze.size):
        raise InputError(f"{path}: expected a maze of size {size}, found size {located.maze.size}")
    return located


def _remark_on_thin_walls(maze: Maze) -> None:
    """Says how large a maze is if its picture may be a floor plan in which each wall is as wide as a cell."""
    free = ~maze.walls
    inside = free[np.ix_(free.any(axis=1), free.any(axis=0))]
    rows, columns = np.add(inside.shape, 2)  # with the outer walls
    if max(rows, columns) > _MANY_CELLS and inside.mean() > _MOSTLY_FREE:
        remark(
            f"{maze.name}: read as {columns} m wide and {rows} m high, with a cell of 1 m for the width of a wall; "
            "if it is a floor plan, --pixel-size sets its scale"
        )


def _map_files(folder: pathlib.Path) -> list[pathlib.Path]:
    """Returns a file of each map in a folder, by their names."""
    try:
        files = [file for file in folder.iterdir() if file.suffix.lower() in SUFFIXES]
    except OSError as error:
        raise InputError(f"{folder}: can't read the folder: {error.strerror}") from error
    by_stem: dict[str, pathlib.Path] = {}
    pictures: set[pathlib.Path] = set()  # of ROS maps
    for file in sorted(files, key=lambda file: (SUFFIXES.index(file.suffix.lower()), file.name)):
        if file.suffix.lower() in ROS_SUFFIXES:
            try:
                pictures.add(picture_of(file))
            except InputError as error:
                if not is_other_yaml(file):
                    raise
                remark(f"{error}; left out")
                continue
        if file not in pictures:
            by_stem.setdefault(file.stem, file)
    if not by_stem:
        raise InputError(f"{folder}: expected maps ({' '.join(SUFFIXES)}), found none")
    return [by_stem[stem] for stem in sorted(by_stem)]
