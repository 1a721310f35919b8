"""JSON files, which are written whole, and files of JSON lines."""

from __future__ import annotations

import json
import pathlib
from typing import Any

from mazebench.errors import InputError
from mazebench.storage.files import open_file, open_whole


def to_line(record: dict[str, Any]) -> str:
    """Returns `record` as one line of JSON."""
    return json.dumps(record, separators=(",", ":"), allow_nan=False) + "\n"


def write_json(path: pathlib.Path, content: Any) -> None:
    """Writes `content` all or nothing: a reader finds the old file or the new one."""
    with open_whole(path) as file:
        file.write((json.dumps(content, indent=1, allow_nan=False) + "\n").encode("utf-8"))


def read_json(path: pathlib.Path) -> Any:
    """Returns the value in a JSON file.

    Raises:
      InputError: if the file can't be read or is not JSON.
    """
    with open_file(path, "file") as file:
        try:
            return json.load(file)
        except ValueError as error:
            raise InputError(f"{path}: expected JSON, found {str(error)[:120]}") from error


def read_lines(path: pathlib.Path) -> list[Any]:
    """Returns the values in a file of JSON lines, none if there is no such file.

    A line that is not JSON, such as the last one after a kill, is passed over.
    """
    found = []
    for line in path.read_bytes().splitlines() if path.exists() else ():
        try:
            found.append(json.loads(line))
        except ValueError:
            continue
    return found
