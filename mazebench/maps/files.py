"""Mazes in files: one text or picture, or a folder of them."""

from __future__ import annotations

import pathlib

from mazebench.errors import InputError
from mazebench.maps.image import read_image_maze
from mazebench.maps.maze import Maze
from mazebench.maps.text import read_text_maze

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp")
TEXT_SUFFIXES = (".txt", ".map")
MAX_FILES = 10_000


def read_maze(path: str | pathlib.Path, size: int | None = None) -> Maze:
    """Reads the maze in one file: a picture if the suffix says so, else text.

    Args:
      path: of the file.
      size: number of cells a side, for a picture whose cells can't be counted.

    Raises:
      InputError: if the file can't be read or holds no legal maze.
    """
    path = pathlib.Path(path)
    if path.suffix.lower() in IMAGE_SUFFIXES:
        return read_image_maze(path, size)
    return read_text_maze(path)


def read_mazes(path: str | pathlib.Path) -> tuple[Maze, ...]:
    """Reads the maze in a file, or the mazes in a folder's map files in the order of their names.

    If a folder holds one map in several formats, as `mazebench generate` writes them, the text is read.

    Raises:
      InputError: if there is no map, one can't be read, or a folder holds more than 10,000.
    """
    path = pathlib.Path(path)
    if not path.is_dir():
        return (read_maze(path),)
    try:
        files = list(path.iterdir())
    except OSError as error:
        raise InputError(f"{path}: can't read the folder: {error.strerror}") from error
    by_stem: dict[str, pathlib.Path] = {}
    for file in sorted(files, key=lambda file: (file.suffix.lower() not in TEXT_SUFFIXES, file.name)):
        if file.suffix.lower() in TEXT_SUFFIXES + IMAGE_SUFFIXES:
            by_stem.setdefault(file.stem, file)
    if not 0 < len(by_stem) <= MAX_FILES:
        suffixes = " ".join(TEXT_SUFFIXES + IMAGE_SUFFIXES)
        raise InputError(f"{path}: expected 1 to {MAX_FILES} maps ({suffixes}), found {len(by_stem)}")
    return tuple(read_maze(by_stem[stem]) for stem in sorted(by_stem))
