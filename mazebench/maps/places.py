"""Places that a user names: a cell "row,column", or a point "1.5m,2.5m" (x, y), whose cell is meant."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from mazebench.errors import InputError
from mazebench.maps.maze import Cell, Maze, MazeError, cell_of_point

_CELL = re.compile(r"(\d+)\s*,\s*(\d+)")
_METRES = r"([-+]?\d*\.?\d+)\s*m"
_POINT = re.compile(rf"{_METRES}\s*,\s*{_METRES}")


def place_text(name: str, place: Any) -> str | None:
    """Returns a place as text; a cell may be given as two ints. None stays None.

    Raises:
      InputError: if it is neither a cell nor a point; `name` is that of the option.
    """
    if place is None:
        return None
    is_cell = isinstance(place, Iterable) and not isinstance(place, str)
    text = (",".join(map(str, place)) if is_cell else str(place)).strip()
    if not (_CELL.fullmatch(text) or _POINT.fullmatch(text)):
        raise InputError(f"expected {name} as a cell 'row,column' or a point '1.5m,2.5m' (x, y), found {place!r}"[:200])
    return text


def cell_of_place(place: str, size: int, cell_size: float) -> Cell:
    """Returns the cell of a place that `place_text` made, in a maze of `size` cells a side or outside of it."""
    if cell := _CELL.fullmatch(place):
        return int(cell[1]), int(cell[2])
    point = _POINT.fullmatch(place)
    assert point is not None, place
    return cell_of_point(float(point[1]) / cell_size, float(point[2]) / cell_size, size)


def free_cell_of_place(name: str, place: str, maze: Maze) -> Cell:
    """Returns the cell of a place that `place_text` made.

    Raises:
      InputError: if it is not free in `maze`; `name` is that of the option.
    """
    try:
        return maze.require_free(cell_of_place(place, maze.size, maze.cell_size))
    except MazeError as error:
        raise InputError(f"{name} {place!r}: {error}, in the {maze.side:g} x {maze.side:g} m of the maze") from error
