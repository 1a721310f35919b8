"""Mazes as text: `#` wall, `.` free, one row a line; DeepMind Lab and labmaze text levels are read too."""

from __future__ import annotations

import codecs
import pathlib

import numpy as np

from mazebench.errors import InputError
from mazebench.maps.file_kinds import kind_of
from mazebench.maps.grids import square_maze
from mazebench.maps.maze import MAX_SIZE, Maze, MazeError
from mazebench.storage.files import open_file, open_whole

_WALL = "#*1"
_FREE = ". 0PG"
# Of the largest legal text: a mark of the encoding, and MAX_SIZE rows of MAX_SIZE cells and two line ends, each of at
# most two bytes.
_MAX_BYTES = 4 + 2 * MAX_SIZE * (MAX_SIZE + 2)
_ENCODINGS = {codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}


def format_maze(maze: Maze) -> str:
    """Returns `maze` as text, one row a line, with a line end after the last."""
    return "".join("".join("#" if wall else "." for wall in row) + "\n" for row in maze.walls)


def parse_maze(text: str, name: str = "maze") -> Maze:
    """Returns the maze that `text` draws; one that is not square is padded with wall, see `square_maze`.

    Raises:
      MazeError: if a character is unknown, the rows differ in length, or the grid is not a legal maze.
    """
    # Only line feeds end a line: splitlines() would also split at characters that a text map must refuse.
    rows = text.replace("\r\n", "\n").strip("\n").split("\n")
    for row, line in enumerate(rows):
        if len(line) != len(rows[0]):
            raise MazeError(
                f"{name}: expected rows of {len(rows[0])} cells like the first, found {len(line)} in row {row}"
            )
        for column, character in enumerate(line):
            if character not in _WALL + _FREE:
                raise MazeError(
                    f"{name}: expected one of {_WALL!r} (wall) or {_FREE!r} (free), "
                    f"found {character!r} at ({row}, {column})"
                )
    return square_maze(np.array([[character in _WALL for character in line] for line in rows], dtype=bool), name)


def read_text_maze(path: str | pathlib.Path) -> Maze:
    """Reads the maze in a text file, ASCII or with a byte-order mark, and names it after the file.

    Raises:
      InputError: if the file can't be read, or is larger than any maze's.
      MazeError: if it is not text or not a legal maze.
    """
    path = pathlib.Path(path)
    with open_file(path, "map") as file:
        content = file.read(_MAX_BYTES + 1)
    kind = kind_of(content)
    if kind is not None:
        raise MazeError(f"{path}: expected a text map, found {kind}")
    if len(content) > _MAX_BYTES:
        raise InputError(f"{path}: expected a text map of at most {_MAX_BYTES} bytes, found more")
    encoding = next((name for mark, name in _ENCODINGS.items() if content.startswith(mark)), "ascii")
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        raise MazeError(
            f"{path}: expected a text map, found byte 0x{content[error.start]:02x} at {error.start}"
        ) from error
    return parse_maze(text, path.stem)


def write_text_maze(maze: Maze, path: str | pathlib.Path) -> None:
    """Writes `maze` as text, all or nothing."""
    with open_whole(path) as file:
        file.write(format_maze(maze).encode("ascii"))
