"""Tables of cells, as spreadsheets and programs write them: fields between commas, semicolons or tabs."""

from __future__ import annotations

import csv
from collections.abc import Sequence

import numpy as np

from mazebench.maps.maze import MazeError
from mazebench.maps.readers.cells import WALL

_SEPARATORS = "\t;,"  # a comma may be the decimal mark between the others
_BOOLEANS = {"true": 1.0, "false": 0.0}
_ONLY_WALLS = {*WALL, "1.0", "100", "100.0", "true"}  # marks beside which an empty field is free


def separator_of(lines: Sequence[str]) -> str | None:
    """Returns the character between the fields of a table, which the first and half of all rows have, or None."""
    rows = [line.strip(" \"'")[:-1] for line in lines if line.strip()]  # strings in a program end with a comma
    for mark in _SEPARATORS:
        if 2 * sum(mark in row for row in rows) >= len(rows) > 0 and mark in rows[0].lstrip("\t"):  # an indent is none
            return mark
    return None


def cells_in_table(lines: Sequence[str], separator: str, name: str) -> list[list[str]]:
    """Returns the fields of each row, without empty ones at the ends. One that is empty among walls alone is "0".

    Raises:
      MazeError: if rows differ in their number of fields, a field is empty, or there is a header or an index.
    """
    try:
        rows = [
            next(csv.reader([line], delimiter=separator, skipinitialspace=True)) for line in lines if line.strip(" ")
        ]
    except csv.Error as error:
        raise MazeError(f"{name}: expected a table of cells, found {error}") from error
    table = [[field.strip(" \"'") for field in row] for row in rows]

    # Spreadsheets add empty fields and rows at the end.
    while table and not any(table[-1]):
        table.pop()
    if not table:
        raise MazeError(f"{name}: expected a table of cells, found empty fields only")
    width = max(number + 1 for row in table for number, field in enumerate(row) if field)
    for number, row in enumerate(table):
        if len(row) < width:
            raise MazeError(f"{name}: expected {width} fields in each row, found {len(row)} in row {number}")
    # A comma within a field is the decimal mark.
    table = [[field.replace(",", ".") for field in row[:width]] for row in table]
    _require_no_labels(table, name)

    marks = {field.lower() for row in table for field in row if field}
    if marks <= _ONLY_WALLS:
        return [[field or "0" for field in row] for row in table]
    for number, row in enumerate(table):
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
                value = _BOOLEANS.get(field.lower())
                numbers[row, column] = float(field) if value is None else value
            except ValueError as error:
                raise MazeError(
                    f"{name}: expected rows of as many numbers, or cells of one character, "
                    f"found {field[:60]!r} at ({row}, {column})"
                ) from error
    return numbers


def _require_no_labels(table: Sequence[Sequence[str]], name: str) -> None:
    """Raises `MazeError` if the first row or column counts, or has different words or letters."""
    for kind, fields in (("row 0", list(table[0])), ("column 0", [row[0] for row in table])):
        labels = fields[1:] if fields[0] == "" else fields
        is_count = [label.removesuffix(".0") for label in labels] in (
            [str(first + number) for number in range(len(labels))] for first in (0, 1)
        )
        are_words = len(set(labels)) == len(labels) and all(label[:1].isalpha() for label in labels)
        if len(labels) > 2 and (is_count or are_words):
            raise MazeError(
                f"{name}: expected cells, found {', '.join(labels[:3])[:60]}, ... in {kind}, a header or an index; "
                "leave it out, as to_csv(header=False, index=False) does"
            )
