"""Episode records on disk: written in protocol order, nothing lost to a kill, never half a line read back.

`episodes.jsonl` grows in protocol order. An episode that ended before one in front of it waits in `journal.jsonl`,
which goes when the last episode is in place.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import math
import os
import pathlib
from collections.abc import Iterator
from typing import Any

from mazebench.errors import InputError
from mazebench.files import open_file, open_to_write, open_whole, read_at_most

EPISODES = "episodes.jsonl"
JOURNAL = "journal.jsonl"
CONFIG = "config.json"
SUMMARY = "summary.json"

MAX_RECORDS_BYTES = 2**28  # of a file of them; the 1,500 local episodes of a benchmark's size take 0.5 MB

_MAX_JSON_BYTES = 2**22  # of a file that is one value; a summary takes some 20 KB
_MAX_LINE = 2**16  # bytes of a record; they take 0.4 KB
_MAX_DEPTH = 32  # of JSON; deeper nesting could not be written or compared, which Python does by recursion

Record = dict[str, Any]


class FolderLock:
    """Keeps other processes out of a folder as long as it is held; a context manager, released by a kill too."""

    def __init__(self, folder: pathlib.Path):
        """Takes the lock.

        Raises:
          InputError: if another process holds it, or there can be none on this file system.
        """
        self._descriptor = os.open(folder, os.O_RDONLY)  # of the folder itself, so that nothing is left in it
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            os.close(self._descriptor)
            if isinstance(error, BlockingIOError):
                raise InputError(f"{folder}: is in use by another process") from None
            raise InputError(f"{folder}: expected a file system that can lock, found: {error.strerror}") from error

    def __enter__(self) -> FolderLock:
        return self

    def __exit__(self, *exception: object) -> None:
        os.close(self._descriptor)


class RecordLog:
    """The records of `num_episodes` episodes in `folder`, those already there included; a context manager."""

    def __init__(self, folder: pathlib.Path, num_episodes: int):
        """Reads what is there, and changes nothing but a last line that is not whole.

        Raises:
          InputError: if it is damaged.
        """
        self._folder = folder
        self._num_episodes = num_episodes
        in_order = repair_and_read_lines(folder / EPISODES, "episode")
        for number, record in enumerate(in_order):
            if record["episode"] != number:
                raise InputError(f"{folder / EPISODES}: expected episode {number} next, found {record['episode']}")
        self._records = dict(enumerate(in_order))
        for record in repair_and_read_lines(folder / JOURNAL, "episode"):
            self._records.setdefault(record["episode"], record)
        self._num_written = len(in_order)

    @property
    def num_done(self) -> int:
        """How many episodes have a record."""
        return len(self._records)

    @property
    def missing(self) -> list[int]:
        """The indices of the episodes that have no record yet."""
        return [index for index in range(self._num_episodes) if index not in self._records]

    @property
    def records(self) -> list[Record]:
        """All records there are, in protocol order."""
        return [self._records[index] for index in sorted(self._records)]

    def add(self, records: list[Record]) -> None:
        """Stores records of episodes that just ended, each by its index `record["episode"]`."""
        waiting = []
        for record in records:
            self._records[record["episode"]] = record
            if record["episode"] != self._num_written:
                waiting.append(record)
            else:
                self._write_in_order()
        for record in waiting:
            if record["episode"] >= self._num_written:
                self._journal.write(to_line(record))
        self._journal.flush()
        self._episodes.flush()

    def finish(self) -> None:
        """Removes the journal; all records must be there."""
        assert self._num_written == self._num_episodes
        self._episodes.flush()
        os.fsync(self._episodes.fileno())  # before there is a summary of them
        self._journal.close()
        (self._folder / JOURNAL).unlink()

    def _write_in_order(self) -> None:
        while self._num_written in self._records:
            self._episodes.write(to_line(self._records[self._num_written]))
            self._num_written += 1

    def __enter__(self) -> RecordLog:
        """Opens the files to write, and puts in place what waited for it."""
        self._episodes = open_to_write(self._folder / EPISODES, "a")
        self._journal = open_to_write(self._folder / JOURNAL, "a")
        self._write_in_order()
        return self

    def __exit__(self, *exception: object) -> None:
        for file in (self._episodes, self._journal):
            with contextlib.suppress(OSError):  # what could not be written was told before, or is in the journal
                file.close()


def to_line(record: Record) -> str:
    """One line of JSON."""
    return json.dumps(record, separators=(",", ":"), allow_nan=False) + "\n"


def parse_json(content: str | bytes, max_depth: int = _MAX_DEPTH) -> Any:
    """The value of a JSON text from outside, of a kind that can be written again: finite numbers, no endless nesting.

    Args:
      content: bytes are UTF-8.
      max_depth: levels of lists and objects in each other.

    Raises:
      ValueError: if it is anything else.
    """
    text = content.decode("utf-8") if isinstance(content, bytes) else content  # json.loads would guess the encoding
    try:
        value = json.loads(text, parse_float=_finite, parse_constant=_finite)
    except RecursionError:
        raise ValueError(f"nesting deeper than {max_depth} levels") from None
    level = [value]
    for _ in range(max_depth + 1):
        holders = [item for item in level if isinstance(item, (dict, list))]
        if not holders:
            return value
        level = [item for holder in holders for item in (holder.values() if isinstance(holder, dict) else holder)]
    raise ValueError(f"nesting deeper than {max_depth} levels")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"the number {text[:20]}, which is no finite one")
    return value


def write_json(path: pathlib.Path, content: Any) -> None:
    """Writes `content` all or nothing: a reader finds the old file or the new one."""
    with open_whole(path) as file:
        file.write((json.dumps(content, indent=1, allow_nan=False) + "\n").encode("utf-8"))


def read_json(path: pathlib.Path) -> Any:
    """The content of a JSON file, as `parse_json` takes it.

    Raises:
      InputError: if it can't be read, is larger than 4 MiB or no such JSON.
    """
    content = read_at_most(path, _MAX_JSON_BYTES, "file")
    if len(content) > _MAX_JSON_BYTES:
        raise InputError(f"{path}: expected at most {_MAX_JSON_BYTES} bytes, found more")
    try:
        return parse_json(content)
    except ValueError as error:
        raise InputError(f"{path}: expected JSON, found {str(error)[:120]}") from error


def read_lines(path: pathlib.Path) -> Iterator[bytes]:
    """Yields the lines of a file of records with their line ends, which the last may lack.

    Raises:
      InputError: if it can't be read, or it or a line is too large.
    """
    num_left = MAX_RECORDS_BYTES
    number = 0
    with open_file(path, "records") as file:
        while line := file.readline(_MAX_LINE + 1):
            number, num_left = number + 1, num_left - len(line)
            if num_left < 0:
                raise InputError(f"{path}: expected records of at most {MAX_RECORDS_BYTES} bytes, found more")
            if len(line) > _MAX_LINE:
                raise InputError(f"{path}: expected a record in line {number}, found more than {_MAX_LINE} bytes")
            yield line


def repair_and_read_lines(path: pathlib.Path, key: str) -> list[Record]:
    """The records of a file of lines, each with a number `key`; a last line that a kill cut short is removed from it.

    Raises:
      InputError: if a whole line is not a record; nothing is removed then.
    """
    if not path.exists():
        return []
    records: list[Record] = []
    end = 0
    for line in read_lines(path):
        if not line.endswith(b"\n"):
            with open_to_write(path, "r+b") as file:
                file.truncate(end)
            break
        end += len(line)
        try:
            record = parse_json(line)
            record[key] += 0
        except (ValueError, TypeError, KeyError) as error:
            raise InputError(
                f"{path}: expected a record in line {len(records) + 1}, found {line.strip()[:60]!r}"
            ) from error
        records.append(record)
    return records
