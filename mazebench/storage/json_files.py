"""JSON files and files of JSON lines: limited in size when read, whole when written."""

from __future__ import annotations

import json
import math
import os
import pathlib
from collections.abc import Iterator
from typing import Any

from mazebench.errors import InputError
from mazebench.storage.files import open_file, open_to_write, open_whole, read_at_most

_MAX_JSON_BYTES = 2**22  # a summary takes some 20 KB
_MAX_LINES_BYTES = 2**28  # the 1,500 local episodes of a benchmark's size take 0.5 MB

JsonObject = dict[str, Any]


def to_line(record: JsonObject) -> str:
    """Returns `record` as one line of JSON."""
    return json.dumps(record, separators=(",", ":"), allow_nan=False) + "\n"


def parse_json(content: str | bytes) -> Any:
    """Returns the value of a JSON text, whose numbers must be finite.

    Raises:
      ValueError: if it is not such a text.
    """
    return json.loads(content, parse_float=_finite, parse_constant=_finite)


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"the number {text[:20]}, which is not finite")
    return value


def write_json(path: pathlib.Path, content: Any, indent: int | None = 1) -> None:
    """Writes `content` all or nothing: a reader finds the old file or the new one. Without `indent`, it is one line.

    Raises:
      OSError: if it can't be written.
    """
    with open_whole(path) as file:
        file.write((json.dumps(content, indent=indent, allow_nan=False) + "\n").encode("utf-8"))


def read_json(path: pathlib.Path) -> Any:
    """Returns the value in a JSON file.

    Raises:
      InputError: if the file can't be read, is larger than 4 MiB or not JSON, or a number is not finite.
    """
    content = read_at_most(path, _MAX_JSON_BYTES, "file")
    try:
        return parse_json(content)
    except ValueError as error:
        raise InputError(f"{path}: expected JSON, found {str(error)[:120]}") from error


def read_lines(path: pathlib.Path) -> Iterator[bytes]:
    """Yields the lines of a file of records with their line ends, which the last line may lack.

    Raises:
      InputError: if the file can't be read or is larger than 256 MiB.
    """
    with open_file(path, "records") as file:
        if os.fstat(file.fileno()).st_size > _MAX_LINES_BYTES:
            raise InputError(f"{path}: expected records of at most {_MAX_LINES_BYTES} bytes, found more")
        yield from file


def repair_and_read_lines(path: pathlib.Path) -> list[JsonObject]:
    """Returns the objects in a file of lines; removes a last line that a kill cut short.

    Raises:
      InputError: if a whole line is not an object; nothing is removed then.
    """
    if not path.exists():
        return []
    records: list[JsonObject] = []
    end = 0
    for line in read_lines(path):
        if not line.endswith(b"\n"):
            with open_to_write(path, "r+b") as file:
                file.truncate(end)
            break
        end += len(line)
        record = _parse_record(line)
        if record is None:
            raise InputError(f"{path}: expected a record in line {len(records) + 1}, found {line.strip()[:60]!r}")
        records.append(record)
    return records


def _parse_record(line: bytes) -> JsonObject | None:
    try:
        record = parse_json(line)
    except ValueError:
        return None
    return record if isinstance(record, dict) else None
