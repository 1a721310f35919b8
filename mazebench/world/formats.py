"""The work of `mazebench generate`: makes mazes, or reads one from a picture, and writes them in several formats."""

from __future__ import annotations

import pathlib
from collections.abc import Callable, Iterator

import numpy as np

from mazebench.errors import InputError, unknown
from mazebench.maps.files import read_maze
from mazebench.maps.generators import generate
from mazebench.maps.image import draw_maze, write_image
from mazebench.maps.maze import Maze
from mazebench.maps.text import write_text_maze
from mazebench.world.export import MESH_FORMATS, write_mesh, write_mjcf

_DEFAULT_SIZE = 13
_PICTURE_PIXELS = 1024  # about the side of a maze's picture


def make_mazes(size: int | None, count: int, seed: int, style: str, image: pathlib.Path | None) -> Iterator[Maze]:
    """Yields `count` mazes of a style, named after style, size, seed and index; or the one maze in the picture `image`.

    Raises:
      InputError: if the style can't make mazes of that size, or the picture shows no maze.
    """
    if image is not None:
        yield read_maze(image, size)
        return
    size = _DEFAULT_SIZE if size is None else size
    for index in range(count):
        yield generate(style, size, np.random.default_rng([seed, index]), f"{style}-{size}-{seed}-{index:03d}")


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
    maze: Maze, folder: pathlib.Path, formats: list[str], source: pathlib.Path | None = None
) -> list[pathlib.Path]:
    """Writes `maze` into `folder` in each format and returns the files.

    Raises:
      InputError: if the folder can't be written, or a file is `source`, the picture that the maze was read from.
    """
    paths = [folder / f"{maze.name}.{_WRITERS[name][0]}" for name in formats]
    for path in paths:
        if source is not None and path.exists() and path.samefile(source):
            raise InputError(
                f"{path}: would overwrite the picture that the maze is read from; give another --out or --format"
            )
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, path in zip(formats, paths, strict=True):
            _WRITERS[name][1](maze, path)
    except OSError as error:
        raise InputError(f"{folder}: can't write there: {error.strerror}") from error
    return paths


def _write_picture(maze: Maze, path: pathlib.Path) -> None:
    write_image(draw_maze(maze, max(1, _PICTURE_PIXELS // maze.size)), path)


_WRITERS: dict[str, tuple[str, Callable[[Maze, pathlib.Path], None]]] = {
    "txt": ("txt", write_text_maze),
    "mjcf": ("xml", write_mjcf),
    "png": ("png", _write_picture),
    **{name: (name, write_mesh) for name in MESH_FORMATS},
}
