"""Mazes in files: one text, picture, array or ROS map, or a folder of them."""

from __future__ import annotations

import pathlib
from typing import Any

import numpy as np

from mazebench.constants import SLIDER_RADIUS
from mazebench.errors import InputError, remark
from mazebench.maps.maze import Maze
from mazebench.maps.maze_options import ReadOptions
from mazebench.maps.older_map import OlderMap, lay_on, one_for_each
from mazebench.maps.readers.arrays import read_array_file
from mazebench.maps.readers.image import grid_of_image, is_picture, read_picture
from mazebench.maps.readers.occupancy_grid import FREE, LocatedMaze, OccupancyGrid, locate_maze
from mazebench.maps.readers.ros import (
    ROS_SUFFIXES,
    is_filter_mask,
    is_map,
    map_of_picture,
    picture_of,
    read_floor_plan,
    read_occupancy,
)
from mazebench.maps.readers.text_map import read_text

_JPEG = (".jpg", ".jpeg", ".jfif")
IMAGE_SUFFIXES = (".png", *_JPEG, ".bmp", ".pgm", ".ppm", ".pbm", ".pnm", ".tif", ".tiff", ".webp", ".gif")
_TABLE_SUFFIXES = (".csv", ".json")  # of files that may be something else
ARRAY_SUFFIXES = (".npy", ".npz")
# In the order in which they are read if a folder holds one map in several: those come first that say the cells' size.
SUFFIXES = (*ROS_SUFFIXES, ".txt", ".map", *_TABLE_SUFFIXES, *ARRAY_SUFFIXES, *IMAGE_SUFFIXES)
# Of a floor plan that is read as a picture of cells: cells a side, and the free share of them. Mazes have more walls.
_MANY_CELLS, _MOSTLY_FREE = 100, 0.8


def read_maze(
    path: str | pathlib.Path, size: int | None = None, *, radius: float = SLIDER_RADIUS, **options: Any
) -> Maze:
    """Reads the maze in one file: a ROS map, an array or a picture if the suffix says so; else a picture or text.

        >>> maze = mazebench.read_maze("plan.png")

    Args:
      path: of the file; of a ROS map, of its YAML file.
      size: N that the maze must have; for a picture whose cells can't be counted, the cells on its longer side.
      radius: m, of the body that is to drive in it.
      **options: those of `mazebench.maps.maze_options.ReadOptions`.

    Raises:
      InputError: if the file can't be read or holds no legal maze.
    """
    return read_located(path, size, radius=radius, **options).maze


def read_mazes(
    path: str | pathlib.Path, size: int | None = None, *, radius: float = SLIDER_RADIUS, **options: Any
) -> tuple[Maze, ...]:
    """Reads the maze in a file, or the mazes in a folder's map files in the order of their names.

        >>> train = mazebench.make_vec("local", 64, mazes=mazebench.read_mazes("plans"))

    If a folder holds one map in several formats, as `mazebench generate` writes them, one of them is read: the first of
    ROS map, text, array, picture.

    Args:
      path: of the file or folder.
      size: as `read_maze` takes it; likewise the radius.
      **options: those of `mazebench.maps.maze_options.ReadOptions`.

    Raises:
      InputError: if there is no map or one can't be read.
    """
    return tuple(read_maze(file, size, radius=radius, **options) for file in _files(pathlib.Path(path).expanduser()))


def read_with_older(
    path: str | pathlib.Path,
    shown: str | pathlib.Path,
    options: ReadOptions,
    is_aligned: bool = False,
    radius: float = SLIDER_RADIUS,
) -> tuple[tuple[Maze, ...], tuple[OlderMap, ...]]:
    """Reads the maze in a file or those in a folder, and their older maps: likewise, or one that is that of all.

    Older maps are laid on the mazes as `lay_on` does.

    Raises:
      InputError: as `read_mazes`, and if there are other numbers of older maps, or one is no older map of its maze.
    """
    files, older_files = (_files(pathlib.Path(each).expanduser()) for each in (path, shown))
    mazes, older = [], []
    for file, older_file in zip(files, one_for_each(older_files, len(files)), strict=True):
        newer = _read_grid(file, None, options)
        located = locate_maze(newer, options, file.stem, radius)
        mazes.append(located.maze)
        grid = _read_grid(older_file, None, options)
        older.append(lay_on(grid, newer, located, options, f"shown {older_file}", is_aligned))
    return tuple(mazes), tuple(older)


def read_located(
    path: str | pathlib.Path, size: int | None = None, *, radius: float = SLIDER_RADIUS, **options: Any
) -> LocatedMaze:
    """Reads the maze in one file, as `read_maze` does, and its place in the frame of the map.

    A point (x, y) of the maze lies at `(x0 + x cos(yaw) - y sin(yaw), y0 + x sin(yaw) + y cos(yaw))` in the map's frame
    if (x0, y0, yaw) is the origin that is returned.
    """
    path, reading = pathlib.Path(path).expanduser(), ReadOptions.of(options)
    located = locate_maze(_read_grid(path, size, reading), reading, path.stem, radius)
    if size not in (None, located.maze.size):
        raise InputError(f"{path}: expected a maze of size {size}, found size {located.maze.size}")
    return located


def _read_grid(path: pathlib.Path, size: int | None, options: ReadOptions) -> OccupancyGrid:
    suffix = path.suffix.lower()
    if suffix in ROS_SUFFIXES:
        return read_occupancy(path)
    if suffix in ARRAY_SUFFIXES:
        return read_array_file(path)
    if suffix not in IMAGE_SUFFIXES and not is_picture(path):
        return read_text(path)
    if (ros_map := map_of_picture(path)) is not None:
        raise InputError(f"{path}: expected a maze, found the picture of a ROS map; give {ros_map}")
    if options.pixel_size is not None:
        return read_floor_plan(path, options.pixel_size)
    grid = grid_of_image(read_picture(path), size, path.stem)

    # The picture may be a floor plan in which each wall is as wide as a cell.
    free = grid.states == FREE
    inside = free[np.ix_(free.any(axis=1), free.any(axis=0))]
    rows, columns = np.add(inside.shape, 2)  # with the outer walls
    if not options.cell_size and max(rows, columns) > _MANY_CELLS and inside.mean() > _MOSTLY_FREE:
        remark(
            f"{path.stem}: read as {columns} m wide and {rows} m high, with a cell of 1 m for the width of a wall; "
            "if it is a floor plan, --pixel-size sets its scale"
        )
    return grid


def _files(path: pathlib.Path) -> list[pathlib.Path]:
    """Returns a file, or one of each map in a folder."""
    return _map_files(path) if path.is_dir() else [path]


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
            if not is_map(file):
                remark(f"{file}: left out, as it names no image and so is no map")
                continue
            pictures.add(picture_of(file).resolve())
            if is_filter_mask(file):
                remark(f"{file}: left out, as by its name it is a mask of a costmap filter, as Nav2 has them")
                continue
        if file.suffix.lower() in _TABLE_SUFFIXES:
            try:
                read_text(file)
            except InputError as error:
                remark(f"{file}: left out, as it is no map: {error}")
                continue
        if file.resolve() not in pictures:
            by_stem.setdefault(file.stem, file)
    if not by_stem:
        raise InputError(f"{folder}: expected maps ({' '.join(SUFFIXES)}), found none")
    return [by_stem[stem] for stem in sorted(by_stem)]
