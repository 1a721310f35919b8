"""JSON files, which are written whole, and files of JSON lines."""

from __future__ import annotations

import json
import pathlib
from typing import Any, TypeVar

import pydantic

from mazebench.errors import InputError, describe_fault
from mazebench.storage.files import open_file, open_whole

_Model = TypeVar("_Model", bound=pydantic.BaseModel)


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
            return parse_json(file.read())
        except ValueError as error:
            raise InputError(f"{path}: expected JSON, found {str(error)[:120]}") from error


def parse_json(text: str | bytes) -> Any:
    """Returns the value that a text in JSON describes.

    Raises:
      ValueError: if it is not JSON, or is nested deeper than Python reads.
    """
    try:
        return json.loads(text)
    except RecursionError as error:
        raise ValueError("values that are nested too deeply") from error


def read_lines(path: pathlib.Path, model: type[_Model]) -> list[_Model]:
    """Returns the values in a file of JSON lines, none if there is no such file.

    A line that is not JSON, such as the last one after a kill, is passed over.

    Raises:
      InputError: if a line is JSON of another form than `model`.
    """
    found = []
    for number, line in enumerate(path.read_bytes().splitlines() if path.exists() else (), 1):
        try:
            found.append(model.model_validate_json(line))
        except pydantic.ValidationError as error:
            if error.errors()[0]["type"] != "json_invalid":
                raise InputError(f"{path}: expected another line {number}, found {describe_fault(error)}") from None
    return found
