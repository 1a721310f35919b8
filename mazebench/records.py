"""Episode records on disk: written in protocol order, nothing lost to a kill, never half a line read back.

`episodes.jsonl` grows in protocol order. An episode that ended before one in front of it waits in `journal.jsonl`,
which goes when the last episode is in place.
"""

from __future__ import annotations

import fcntl
import json
import os
import pathlib
from typing import Any

from mazebench.errors import InputError

EPISODES = "episodes.jsonl"
JOURNAL = "journal.jsonl"
CONFIG = "config.json"
SUMMARY = "summary.json"

Record = dict[str, Any]


def make_folder(path: pathlib.Path) -> None:
    """Makes a folder to write to.

    Raises:
      InputError: if that can't be.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path}: can't write there: {error.strerror}") from error


class FolderLock:
    """Keeps other processes out of a folder as long as it is held; a context manager, released by a kill too."""

    def __init__(self, folder: pathlib.Path):
        """Takes the lock.

        Raises:
          InputError: if another process holds it.
        """
        self._descriptor = os.open(folder, os.O_RDONLY)  # of the folder itself, so that nothing is left in it
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(self._descriptor)
            raise InputError(f"{folder}: is in use by another process") from None

    def __enter__(self) -> FolderLock:
        return self

    def __exit__(self, *exception: object) -> None:
        os.close(self._descriptor)


class RecordLog:
    """The records of `num_episodes` episodes in `folder`, those already there included; a context manager."""

    def __init__(self, folder: pathlib.Path, num_episodes: int):
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
        self._episodes = open(folder / EPISODES, "a", encoding="utf-8")  # noqa: SIM115 (closed by __exit__)
        self._journal = open(folder / JOURNAL, "a", encoding="utf-8")  # noqa: SIM115
        self._write_in_order()

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
        self._journal.close()
        (self._folder / JOURNAL).unlink()

    def _write_in_order(self) -> None:
        while self._num_written in self._records:
            self._episodes.write(to_line(self._records[self._num_written]))
            self._num_written += 1

    def __enter__(self) -> RecordLog:
        return self

    def __exit__(self, *exception: object) -> None:
        self._episodes.close()
        self._journal.close()


def to_line(record: Record) -> str:
    """One line of JSON."""
    return json.dumps(record, separators=(",", ":"), allow_nan=False) + "\n"


def write_json(path: pathlib.Path, content: Any) -> None:
    """Writes `content` all or nothing: a reader finds the old file or the new one."""
    temporary = path.with_name(path.name + ".tmp")
    with temporary.open("w", encoding="utf-8") as file:
        file.write(json.dumps(content, indent=1, allow_nan=False) + "\n")
        file.flush()
        os.fsync(file.fileno())
    temporary.replace(path)


def read_json(path: pathlib.Path) -> Any:
    """The content of a JSON file.

    Raises:
      InputError: if it can't be read or is no JSON.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: can't read: {error.strerror}") from error
    except ValueError as error:
        raise InputError(f"{path}: expected JSON, found {error}") from error


def repair_and_read_lines(path: pathlib.Path, key: str) -> list[Record]:
    """The records of a file of lines, each with a number `key`; a last line that a kill cut short is removed from it.

    Raises:
      InputError: if a whole line is not a record.
    """
    if not path.exists():
        return []
    content = path.read_bytes()
    end = content.rfind(b"\n") + 1
    if end < len(content):
        os.truncate(path, end)
    records = []
    for number, line in enumerate(content[:end].splitlines(), 1):
        try:
            record = json.loads(line)
            record[key] += 0
        except (ValueError, TypeError, KeyError) as error:
            raise InputError(f"{path}: expected a record in line {number}, found {line[:60]!r}") from error
        records.append(record)
    return records
