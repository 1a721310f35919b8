"""Cells that characters or numbers stand for, as states of an occupancy grid.

`R` and `C` are the numbers of rows and columns of cells. Row 0 is on top.
"""

from __future__ import annotations

import re
import string
from collections.abc import Sequence

import numpy as np

from mazebench.maps.maze import MazeError
from mazebench.maps.readers.occupancy_grid import FREE, OCCUPIED, UNKNOWN, OccupancyGrid

WALL = "#*1%█▓■⬛" + "".join(map(chr, range(0x2500, 0x2580)))  # the last are lines of boxes
_FREE = ". 0·PG□⬜"
_ASCII_BOX = "+-|"  # walls where there are no others, or the first row is made of them
_MOVING_AI_WALL = "@OTW"  # out of bounds, trees and water
_WORD = re.compile(r"[a-z]{3,}")
_MAX_FREE, _MIN_OCCUPIED = 25, 65  # per cent, of map_saver
_LEAST_PERCENT = 50  # that the largest number of an occupancy grid has; smaller ones are codes of something else


def grid_of_numbers(array: np.ndarray, name: str) -> OccupancyGrid:
    """Returns the cells in an array (`[R, C]`) of walls, or of occupancy.

    Walls are bool, or 0 and 1. Occupancy is -1 where unknown, and 0 and 1 or per cent up to 100 elsewhere.

    Raises:
      MazeError: if the array holds something else.
    """
    if array.ndim != 2 or array.dtype.kind not in "biuf" or not array.size:
        hint = "; of a picture, give one channel" if array.shape[2:] in ((1,), (3,), (4,)) else ""
        raise MazeError(
            f"{name}: expected a two-dimensional array of numbers, found shape {array.shape} {array.dtype}{hint}"
        )
    is_whole = array.dtype.kind != "f" or bool((array == np.round(array)).all())
    is_ternary = np.isin(array, (UNKNOWN, 0, 1)).all()  # as in ROS 2's OccupancyGrid, and in Player's maps
    is_percent = is_whole and array.min() >= UNKNOWN and _LEAST_PERCENT <= array.max() <= OCCUPIED
    if not (is_ternary or is_percent):
        found = np.unique(array)
        values = ", ".join(map(str, found[:6])) + (f", ... {found[-1]}" if len(found) > 6 else "")
        raise MazeError(
            f"{name}: expected walls as bool or as 0 and 1, or occupancy as -1, 0 and 1 or as per cent up to 100, "
            f"found {array.dtype} with the values {values}; `array == VALUE` says which are walls"
        )
    states = np.full(array.shape, UNKNOWN, dtype=np.int8)
    states[(array >= 0) & (array <= (0 if is_ternary else _MAX_FREE))] = FREE
    states[array >= (1 if is_ternary else _MIN_OCCUPIED)] = OCCUPIED
    return OccupancyGrid(states, is_cells=True)


def grid_of_characters(rows: Sequence[str], name: str, is_moving_ai: bool = False) -> OccupancyGrid:
    """Returns the cells that rows of characters draw.

    Letters and digits that are no wall mark free cells, such as starts. What a short row lacks is wall.

    Args:
      rows: from top to bottom.
      name: of the maze, for errors.
      is_moving_ai: whether the letters are those of the MovingAI benchmarks.

    Raises:
      MazeError: if a character is unknown, or none is a wall.
    """
    found = set("".join(rows))
    if found <= set(string.digits) and not found <= set("01"):
        return grid_of_numbers(np.array([[int(digit) for digit in sorted(found)]]), name)  # refuses such codes
    has_its_walls = is_moving_ai or ("@" in found and not found & set(WALL))
    wall = _MOVING_AI_WALL if has_its_walls else WALL
    if not found & set(wall):
        wall = _ASCII_BOX
    elif set(rows[0].strip()) <= set(_ASCII_BOX):
        wall += _ASCII_BOX
    marks = {letter for letter in found - set(wall + _FREE) if letter.isascii() and (letter.isalnum() or letter == "@")}
    for row, line in enumerate(rows):
        if word := next((word for word in _WORD.findall(line) if len(set(word)) >= 3), None):
            raise MazeError(f"{name}: expected rows of cells, found the word {word!r} in row {row}; delete such lines")
        for column, letter in enumerate(line):
            if letter not in wall + _FREE and letter not in marks:
                raise MazeError(
                    f"{name}: expected '#*1@%' or a block for wall, '. 0' or a letter for free, "
                    f"found {letter!r} at ({row}, {column})"
                )
    if not found & set(wall) and found & marks:
        raise MazeError(f"{name}: expected '#*1@%' or a block for wall, found only {' '.join(sorted(found))}")

    # The columns end with the last character but for blanks. Of shorter rows, the rest is wall.
    width = max(len(line.rstrip()) for line in rows)
    is_short = min(map(len, rows)) < width
    lines = [line[:width].ljust(width, wall[0]) for line in rows]
    states = np.array([[OCCUPIED if letter in wall else FREE for letter in line] for line in lines], dtype=np.int8)
    changes = [f"{', '.join(sorted(marks))} read as free"] if marks else []
    if is_short:
        changes.append("short rows filled with wall")
    return OccupancyGrid(states, changes=tuple(changes), is_cells=True, is_defined=is_moving_ai)
