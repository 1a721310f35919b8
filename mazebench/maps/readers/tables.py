"""Tables of cells: fields between commas, semicolons or tabs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mazebench.maps.maze import MazeError

_SEPARATORS = "\t;,"
_BOOLEANS = {"True": 1.0, "False": 0.0}


def separator_of(lines: Sequence[str]) -> str | None:
    """Returns the character between the fields of a table, which the first and half of all rows have, or None."""
    rows = [line.strip(" \"'")[:-1] for line in lines if line.strip()]  # strings in a program end with a comma
    for mark in _SEPARATORS:
        if 2 * sum(mark in row for row in rows) >= len(rows) > 0 and mark in rows[0].lstrip("\t"):  # an indent is none
            return mark
    return None


def cells_in_table(lines: Sequence[str], separator: str, name: str) -> list[list[str]]:
    """Returns the fields of each row.

    Raises:
      MazeError: if rows differ in their number of fields, or a field is empty.
    """
    table = [[field.strip(" \"'") for field in line.split(separator)] for line in lines if line.strip()]
    for number, row in enumerate(table):
        if len(row) != len(table[0]):
            raise MazeError(f"{name}: expected {len(table[0])} fields in each row, found {len(row)} in row {number}")
        if "" in row:
            raise MazeError(f"{name}: expected a value in each field, found none at ({number}, {row.index('')})")
    return table


def numbers_in_table(cells: Sequence[Sequence[str]], name: str) -> np.ndarray:
    """Returns fields as numbers, `[R, C]` float.

    Raises:
      MazeError: if one is no number.
    """
    numbers = np.empty((len(cells), len(cells[0])))
    for row, fields in enumerate(cells):
        for column, field in enumerate(fields):
            try:
                numbers[row, column] = _BOOLEANS[field] if field in _BOOLEANS else float(field)
            except ValueError as error:
                raise MazeError(
                    f"{name}: expected rows of as many numbers, or cells of one character, "
                    f"found {field[:60]!r} at ({row}, {column})"
                ) from error
    return numbers
