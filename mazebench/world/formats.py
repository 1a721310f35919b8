"""The work of `mazebench generate`: makes mazes, or reads one from a map, and writes them in several formats."""

from __future__ import annotations

import functools
import pathlib
from collections.abc import Callable, Iterator

import numpy as np

from mazebench.errors import InputError, unknown
from mazebench.maps.files import read_placed
from mazebench.maps.generators import generate
from mazebench.maps.maze import Maze, resized
from mazebench.maps.options import OCCUPANCY_OPTIONS, PICTURE_OPTIONS, MapOptions
from mazebench.maps.pictures import draw_maze, write_image
from mazebench.maps.readers.occupancy import PlacedMaze
from mazebench.maps.readers.ros import write_ros_map
from mazebench.maps.text import write_text_maze
from mazebench.world.export import MESH_FORMATS, write_mesh, write_mjcf

_DEFAULT_SIZE = 13
_PICTURE_PIXELS = 1024  # about the side of a maze's picture


def make_mazes(
    size: int | None, count: int, seed: int, style: str, source: pathlib.Path | None, options: MapOptions
) -> Iterator[PlacedMaze]:
    """Yields `count` mazes of a style, named after style, size, seed and index; or the one maze in the map `source`.

    Raises:
      InputError: if the style can't make mazes of that size, or the map holds no maze.
    """
    if source is not None:
        yield read_placed(source, size, options)
        return
    options.require_defaults((*OCCUPANCY_OPTIONS, *PICTURE_OPTIONS), "maps", "a generated maze")
    size = _DEFAULT_SIZE if size is None else size
    for index in range(count):
        name = f"{style}-{size}-{seed}-{index:03d}"
        maze = generate(style, size, np.random.default_rng([seed, index]), name)
        yield PlacedMaze(resized(maze, options.cell_size))


def parse_formats(text: str) -> list[str]:
    """Returns the formats in a list separated by commas, in its order.

    Raises:
      InputError: if one is unknown.
    """
    formats = [name.strip() for name in text.split(",")]
    for name in formats:
        if name not in _WRITERS:
            raise unknown("format", name, _WRITERS)
    return formats


def write_maze(
    placed: PlacedMaze, folder: pathlib.Path, formats: list[str], source: pathlib.Path | None = None
) -> list[pathlib.Path]:
    """Writes a maze into `folder` in each format and returns the files; a ROS map overlays the one it was read from.

    Raises:
      InputError: if the folder can't be written, or a file is `source`, the map that the maze was read from.
    """
    written = {name: [folder / f"{placed.maze.name}.{suffix}" for suffix in _WRITERS[name][0]] for name in formats}
    paths = [path for several in written.values() for path in several]
    for path in paths:
        if source is not None and path.exists() and path.samefile(source):
            raise InputError(
                f"{path}: would overwrite the map that the maze is read from; give another --out or --format"
            )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, (first, *_) in written.items():
            _WRITERS[name][1](placed, first)
    except OSError as error:
        raise InputError(f"{folder}: can't write there: {error.strerror}") from error
    return paths


def _write_picture(maze: Maze, path: pathlib.Path) -> None:
    write_image(draw_maze(maze, max(1, _PICTURE_PIXELS // maze.size)), path)


def _in_own_frame(write: Callable[[Maze, pathlib.Path], None]) -> Callable[[PlacedMaze, pathlib.Path], None]:
    """Returns a writer of a format whose frame is the maze's."""
    return lambda placed, path: write(placed.maze, path)


def _write_ros_map(placed: PlacedMaze, path: pathlib.Path) -> None:
    write_ros_map(placed.maze, path, placed.origin)


# By format: the suffixes of its files, and what writes them all, given the path of the first.
_WRITERS: dict[str, tuple[tuple[str, ...], Callable[[PlacedMaze, pathlib.Path], None]]] = {
    "txt": (("txt",), _in_own_frame(write_text_maze)),
    "mjcf": (("xml",), _in_own_frame(write_mjcf)),
    "mjcf-textured": (("textured.xml",), _in_own_frame(functools.partial(write_mjcf, textures=True))),
    "png": (("png",), _in_own_frame(_write_picture)),
    "ros": (("yaml", "pgm"), _write_ros_map),
    **{name: ((name,), _in_own_frame(write_mesh)) for name in MESH_FORMATS},
}
