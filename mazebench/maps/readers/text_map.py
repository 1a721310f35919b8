"""Maps as text: rows of characters, and what other programs write as text."""

from __future__ import annotations

import codecs
import contextlib
import pathlib
import re

import numpy as np

from mazebench.maps.file_kinds import kind_of, way_out
from mazebench.maps.maze import MAX_SIZE, MazeError
from mazebench.maps.readers.cells import grid_of_characters, grid_of_numbers
from mazebench.maps.readers.occupancy_grid import OccupancyGrid
from mazebench.maps.readers.tables import cells_in_table, numbers_in_table, separator_of
from mazebench.storage.files import read_at_most
from mazebench.storage.json_files import parse_json

_MAX_BYTES = 2**26  # 1,024 rows of 1,024 numbers with 18 digits take a third of it
_MAX_ROWS = 4 * MAX_SIZE  # of which an area is the maze
_MAX_WIDTH = 25 * _MAX_ROWS  # characters in a row; numpy.savetxt writes 25 for each number
_ENCODINGS = {codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}
_POSTS = re.compile(r"([+o*.])(-+)\1(?:\2\1)*")  # the first line of a maze with walls between posts
# Characters of double width, as East Asian fonts have them, and what only chooses how the one before is drawn.
_SAME = {0xFEE0 + code: code for code in range(0x21, 0x7F)} | {0x3000: " ", 0xFE0F: None}


def read_text(path: pathlib.Path) -> OccupancyGrid:
    """Reads the cells in a text file, UTF-8 or with a byte-order mark.

    Raises:
      InputError: if the file can't be read, or is larger than any maze's.
      MazeError: if it is not text, or no text of `grid_of_text`.
    """
    content = read_at_most(path, _MAX_BYTES, "text map")
    if (kind := kind_of(content)) is not None:
        raise MazeError(f"{path}: expected a text map, found {kind}{way_out(kind)}")
    encoding = next((name for mark, name in _ENCODINGS.items() if content.startswith(mark)), "utf-8")
    try:
        text = content.decode(encoding)
        position = text.find("\0")
    except UnicodeDecodeError as error:
        position = error.start
    if position >= 0:
        raise MazeError(
            f"{path}: expected a text map, found byte 0x{content[position]:02x} at {position}{way_out(None)}"
        )
    return grid_of_text(text, path.stem)


def grid_of_text(text: str, name: str) -> OccupancyGrid:
    """Returns the cells that a text holds: rows of characters, or of numbers as `grid_of_numbers` takes them.

    Of other programs, it reads MovingAI's maps, levels of DeepMind Lab and labmaze, D4RL's one line, lists of lists as
    in Gymnasium-Robotics, tables (CSV), mazes of walls between posts, and the grid of a JSON object.

    Raises:
      MazeError: if it is none of these.
    """
    # Only these end a line: splitlines() would also split at characters that a text map must refuse.
    text = text.replace("\r\n", "\n").replace("\r", "\n").translate(_SAME)
    num_rows = 0 if text.lstrip().startswith("{") else text.count("]") or text.count("\n") + text.count("\\")
    if num_rows > _MAX_ROWS:
        raise MazeError(f"{name}: expected at most {MAX_SIZE} cells a side, found {num_rows:,} rows")
    if text.startswith("type "):
        return _moving_ai(text, name)
    if text.lstrip().startswith("{"):
        return _grid_of_json(text, name)
    if "[" in text:  # a list of rows, as Python, JSON or NumPy write it
        lines = [" ".join(row.strip("[, \n").split()) for row in text[text.find("[") : text.rfind("]")].split("]")]
        lines = lines[0].split(",") if len(list(filter(None, lines))) == 1 else lines
    else:
        lines = re.sub(r"\\n|\\+", "\n", text).split("\n")  # D4RL ends a row with a backslash
    if len(lines) > _MAX_ROWS or max(map(len, lines), default=0) > _MAX_WIDTH:
        raise MazeError(f"{name}: expected at most {MAX_SIZE} cells a side, found more")
    lines = [_without_brackets(line) for line in lines]
    _require_one_maze(lines, name)
    if (separator := separator_of(lines)) is not None:
        cells = cells_in_table(lines, separator, name)
    else:
        lines = [re.sub(r"^\s*[\"']+|[\"',]+\s*$|[\"']", "", line) for line in lines]  # of strings in a program
        cells = [line.split() for line in lines if line.strip()]  # a table with blanks, or none
        if not cells:
            raise MazeError(f"{name}: expected a text map, found no row")
        if len({len(row) for row in cells}) > 1 or len(cells[0]) < 3:
            return _grid_of_rows([line for line in lines if line.strip()], name)
    if all(len(cell) == 1 for row in cells for cell in row):
        return grid_of_characters(["".join(row) for row in cells], name)
    return grid_of_numbers(numbers_in_table(cells, name), name)


def _grid_of_json(text: str, name: str) -> OccupancyGrid:
    """Returns the cells of the only list of rows of numbers in a JSON object."""
    expected = f"{name}: expected JSON with one list of rows"
    try:
        content = parse_json(text)
    except ValueError as error:
        raise MazeError(f"{expected}, found {str(error)[:80]}") from error
    grids = []
    for value in content.values():
        with contextlib.suppress(ValueError):  # of rows that differ in length
            grids.append(np.array(value))
    grids = [grid for grid in grids if grid.ndim == 2 and grid.dtype.kind in "bif"]
    if len(grids) != 1:
        hint = "; draw the plan as a picture, or write its cells as text" if "features" in content else ""  # GeoJSON
        raise MazeError(f"{expected}, found the keys {', '.join(content)}"[:200] + hint)
    return grid_of_numbers(grids[0], name)


def _moving_ai(text: str, name: str) -> OccupancyGrid:
    """Returns the cells of a map of the MovingAI benchmarks, whose header names its height and width."""
    head, _, body = text.partition("\nmap\n")
    values = dict(line.split(maxsplit=1) for line in head.split("\n") if len(line.split()) == 2)
    rows = [line.rstrip().upper() for line in body.rstrip("\n").split("\n")]
    found = f"{len(rows)} x {len(rows[0])}"
    if any(len(row) != len(rows[0]) for row in rows) or found != f"{values.get('height')} x {values.get('width')}":
        raise MazeError(
            f"{name}: expected a MovingAI map of {values.get('height')} rows of {values.get('width')} cells after the "
            f"line 'map', found {len(rows)} of {min(map(len, rows))} to {max(map(len, rows))}"
        )
    return grid_of_characters(rows, name, is_moving_ai=True)


def _without_brackets(line: str) -> str:
    """Returns a row without the round brackets of a tuple in a program."""
    line = re.sub(r"^\s*\(+", "", line)
    end = line.find(")", len(line.rstrip().rstrip("),")))
    return line if end < 0 else line[:end]


def _require_one_maze(lines: list[str], name: str) -> None:
    """Raises `MazeError` if blank lines separate blocks that each begin and end with a row of wall."""
    blocks = [block.strip("\n").split("\n") for block in re.split(r"\n *\n", "\n".join(lines).strip())]
    ends = {letter for block in blocks for line in (block[0], block[-1]) for letter in line}
    if len(blocks) > 1 and len(ends - set(" ,;\t\"'")) == 1 and all(len(block) > 2 for block in blocks):
        raise MazeError(f"{name}: expected one maze, found {len(blocks)} with blank lines between; give each a file")


def _grid_of_rows(rows: list[str], name: str) -> OccupancyGrid:
    """Returns the cells of rows of characters, which may draw walls between posts.

    In a maze of posts, every second row has a post at each step, and rooms are blank or have a letter.
    """
    posts = _POSTS.fullmatch(rows[0].strip())
    if posts is None or len(posts[2]) == 1:
        return grid_of_characters(rows, name)
    post, step = posts[1], len(posts[2]) + 1
    indent, width = rows[0].index(post), len(posts[0])
    lines = [row[indent:].ljust(width) for row in rows]
    without = [number for number in range(0, len(lines), 2) if set(lines[number][:width:step]) != {post}]

    # What is between two posts of a row, and in the rooms: a whole wall or none.
    gaps, rooms = (
        [row[at : at + step - 1] for row in some for at in range(1, width, step)] for some in (lines[::2], lines[1::2])
    )
    wall, blank = "-" * (step - 1), " " * (step - 1)
    has_walls = not set(gaps) <= {wall, blank} or any(set("#-|") & set(room) for room in rooms if room != wall)
    if post == "+" and (without or has_walls or "." in "".join(rooms)):
        return grid_of_characters(rows, name)  # a plan with walls of lines and their corners
    if without or len(rows) % 2 == 0 or has_walls:
        found = f"none in row {without[0]}" if without else "a wall in a room" if has_walls else f"{len(rows)} rows"
        raise MazeError(f"{name}: expected rows of posts and of rooms in turns, found {found}")

    # A row for each row of posts and of rooms, and a column for each post and each room between two.
    columns = sorted({column for start in range(0, width, step) for column in (start, start + 1) if column < width})
    walls = {post, "-", "|"}
    return grid_of_characters(["".join("#" if line[at] in walls else " " for at in columns) for line in lines], name)
