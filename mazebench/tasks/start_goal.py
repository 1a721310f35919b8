"""A start or a goal of one's own: a cell "row,column", or a point "1.5m,2.5m" (x, y), whose cell is meant."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from mazebench.errors import InputError
from mazebench.maps.maze import Cell, Maze, MazeError

_CELL = re.compile(r"(\d+)\s*,\s*(\d+)")
_METRES = r"([-+]?\d*\.?\d+)\s*m"
_POINT = re.compile(rf"{_METRES}\s*,\s*{_METRES}")


def end_text(name: str, end: Any) -> str | None:
    """Returns a start or a goal as text; a cell may be given as two ints. None stays None.

    Raises:
      InputError: if it is neither a cell nor a point; `name` is that of the option.
    """
    if end is None:
        return None
    text = ",".join(map(str, end)) if isinstance(end, Iterable) and not isinstance(end, str) else str(end)
    if not (_CELL.fullmatch(text.strip()) or _POINT.fullmatch(text.strip())):
        raise InputError(f"expected {name} as a cell 'row,column' or a point '1.5m,2.5m' (x, y), found {end!r}"[:200])
    return text.strip()


def cell_of_end(name: str, end: str, maze: Maze) -> Cell:
    """Returns the cell of a start or a goal that `end_text` made.

    Raises:
      InputError: if it is not free in `maze`; `name` is that of the option.
    """
    if cell := _CELL.fullmatch(end):
        row, column = map(int, cell.groups())
        try:
            return maze.require_free((row, column))
        except MazeError as error:
            raise InputError(f"{name} {end!r}: {error}") from error
    point = _POINT.fullmatch(end)
    assert point is not None, end
    x, y = map(float, point.groups())
    is_inside = 0 <= x < maze.side and 0 <= y < maze.side
    if not is_inside or not maze.is_free(maze.cell_at(x, y)):
        found = "a wall" if is_inside else "one outside"
        raise InputError(f"{name} {end!r}: {maze.name}: expected a point {_describe_extent(maze)}, found {found}")
    return maze.cell_at(x, y)


def _describe_extent(maze: Maze) -> str:
    """Returns the side of a maze and the part that its free cells span, which padding may have moved up."""
    bottom, right = maze.free_cells.max(axis=0)
    top, left = maze.free_cells.min(axis=0)
    low, high = (
        ", ".join(f"{maze.cell_size * number:g}" for number in corner)
        for corner in ((left, maze.size - 1 - bottom), (right + 1, maze.size - top))
    )
    return f"in the {maze.side:g} x {maze.side:g} m of the maze, whose free cells reach from ({low}) to ({high}) m"
