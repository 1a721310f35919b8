"""The work of `mazebench generate`: makes mazes, or reads one from a map, and writes them in several formats."""

from __future__ import annotations

import dataclasses
import functools
import pathlib
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from mazebench.errors import InputError, unknown
from mazebench.maps.kinds import generate
from mazebench.maps.maze import resized
from mazebench.maps.maze_files import read_located
from mazebench.maps.maze_options import ReadOptions
from mazebench.maps.pictures import draw_plan, write_image
from mazebench.maps.readers.occupancy_grid import LocatedMaze
from mazebench.maps.readers.ros import ROS_SUFFIXES, picture_of, write_ros_map
from mazebench.maps.text import write_text_maze
from mazebench.storage.files import make_folder, writing_to
from mazebench.world.export import MESH_FORMATS, write_mesh, write_mjcf

_DEFAULT_SIZE = 13
_ROS = "ros"  # the format whose files have a frame of their own
_PICTURE_PIXELS = 1024  # about the side of a maze's picture


class _Format(NamedTuple):
    suffixes: tuple[str, ...]  # of the files that a maze is written to
    write: Callable[..., None]  # writes them all, given the path of the first


def make_mazes(
    size: int | None, count: int, seed: int, kind: str, source: pathlib.Path | None, options: ReadOptions
) -> Iterator[LocatedMaze]:
    """Yields `count` mazes of a kind, named after kind, size, seed and index; or the one maze in the map `source`.

    Raises:
      InputError: if the kind has no mazes of that size, the map holds no maze, or options are for the other of both.
    """
    for name, found in options.changed().items():
        if source is None and name != "cell_size":
            raise InputError(f"expected a map of your own (--mazes) with {name} {found}, found none")
    if source is not None:
        if count > 1:
            raise InputError(f"expected a count of 1 beside --mazes, found {count}")
        yield read_located(source, size, **dataclasses.asdict(options))
        return
    size = _DEFAULT_SIZE if size is None else size
    for index in range(count):
        name = f"{kind}-{size}-{seed}-{index:03d}"
        maze = generate(kind, size, np.random.default_rng([seed, index]), name)
        yield LocatedMaze(resized(maze, options.cell_size))


def parse_formats(text: str) -> list[str]:
    """Returns the formats in a list separated by commas, in its order."""
    formats = [name.strip() for name in text.split(",")]
    for name in formats:
        if name not in _FORMATS:
            raise unknown("format", name, _FORMATS)
    return formats


def write_maze(
    located: LocatedMaze, folder: pathlib.Path, formats: list[str], source: pathlib.Path | None = None
) -> list[pathlib.Path]:
    """Writes a maze into `folder` in each format and returns the files; a ROS map overlays the one it was read from.

    Raises:
      InputError: if the folder can't be written, or a file is `source`, the map that the maze was read from, or its
        picture.
    """
    paths_of = {
        name: [folder / f"{located.maze.name}.{suffix}" for suffix in _FORMATS[name].suffixes] for name in formats
    }
    paths = [path for several in paths_of.values() for path in several]
    read_from = [] if source is None else [source]
    if source is not None and source.suffix.lower() in ROS_SUFFIXES:
        read_from.append(picture_of(source))
    for path in paths:
        if path.exists() and any(path.samefile(each) for each in read_from):
            raise InputError(
                f"{path}: would overwrite the map that the maze is read from; give another --out or --format"
            )
    make_folder(folder)
    with writing_to(folder):
        for name in formats:
            frame = (located.origin,) if name == _ROS else ()
            _FORMATS[name].write(located.maze, paths_of[name][0], *frame)
    return paths


_FORMATS: dict[str, _Format] = {
    "txt": _Format(("txt",), write_text_maze),
    "mjcf": _Format(("xml",), write_mjcf),
    "mjcf-textured": _Format(("textured.xml",), functools.partial(write_mjcf, textures=True)),
    "mjcf-robot": _Format(("robot.xml",), functools.partial(write_mjcf, for_robot=True)),
    "png": _Format(
        ("png",), lambda maze, path: write_image(draw_plan(maze, max(1, _PICTURE_PIXELS // maze.size)), path)
    ),
    _ROS: _Format(("yaml", "pgm"), write_ros_map),  # which also takes the frame of the map
    **{name: _Format((name,), write_mesh) for name in MESH_FORMATS},
}
