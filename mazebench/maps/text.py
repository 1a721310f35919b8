"""Mazes as text, as this package writes them: `#` wall, `.` free, one row a line."""

from __future__ import annotations

import pathlib

import numpy as np

from mazebench.maps.maze import Maze, MazeError
from mazebench.storage.files import open_whole


def format_maze(maze: Maze) -> str:
    """Returns `maze` as text, one row a line, with a line end after the last."""
    return format_walls(maze.walls)


def format_walls(walls: np.ndarray) -> str:
    """Returns walls (`[N, N]` bool) as text, one row a line, with a line end after the last."""
    return "".join("".join("#" if wall else "." for wall in row) + "\n" for row in walls)


def parse_maze(text: str, name: str = "maze") -> Maze:
    """Returns the maze of which `format_maze` returned the text; `mazebench.maps.maze_files` reads what others write.

    Raises:
      MazeError: if the text is no such one.
    """
    return Maze(parse_walls(text, name), name)


def parse_walls(text: str, name: str) -> np.ndarray:
    """Returns `[N, N]` bool: the walls of which `format_walls` returned the text.

    Raises:
      MazeError: if the text is no such one; `name` is that of the maze.
    """
    rows = text.strip("\n").split("\n")
    if set(map(len, rows)) != {len(rows)} or not set("".join(rows)) <= set("#."):
        raise MazeError(
            f"{name}: expected as many rows as columns, of '#' (wall) and '.' (free), found {rows[0]!r}, ..."
        )
    return np.array([[letter == "#" for letter in row] for row in rows])


def write_text_maze(maze: Maze, path: str | pathlib.Path) -> None:
    """Writes `maze` as text, all or nothing."""
    with open_whole(path) as file:
        file.write(format_maze(maze).encode("ascii"))
