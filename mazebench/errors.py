"""The errors that the command line prints as one line: of bad input (exit status 2) and of failed runs (1)."""

from __future__ import annotations

import io
import os
import pathlib
import stat
from collections.abc import Iterable


class InputError(ValueError):
    """What a user gave can't be used; the message says what was expected and what was found, in one line."""

    def __init__(self, message: str):
        """Shows in `message` whatever it quotes that does not print, such as names of files with line ends in them."""
        super().__init__(one_line(message))


class RunError(RuntimeError):
    """A run that was well asked for can't go on; the message says what happened and what is kept."""


def one_line(text: str) -> str:
    """`text` with what does not print escaped: line ends, and what would command a terminal."""
    return "".join(letter if letter.isprintable() else letter.encode("unicode_escape").decode() for letter in text)


def open_file(path: str | pathlib.Path, kind: str) -> io.BufferedReader:
    """Opens a file from outside to read; a pipe, which might never end, or a device is refused.

    Raises:
      InputError: if it can't be read; the message calls it a `kind`.
    """
    try:
        file = open(path, "rb", opener=_open_at_once)  # noqa: SIM115 (closed by the caller)
    except (OSError, ValueError) as error:  # ValueError for a name that no file can have
        said = error.strerror if isinstance(error, OSError) else str(error)
        raise InputError(f"{path}: can't read the {kind}: {said}") from error
    if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        file.close()
        raise InputError(f"{path}: can't read the {kind}: it is a pipe or a device")
    return file


def read_at_most(path: str | pathlib.Path, num_bytes: int, kind: str) -> bytes:
    """The content of a file from outside, cut off one byte after `num_bytes`, so that the caller sees if it is larger.

    Raises:
      InputError: if it can't be read; the message calls it a `kind`.
    """
    with open_file(path, kind) as file:
        size = os.fstat(file.fileno()).st_size
        try:
            return file.read(min(size, num_bytes) + 1)  # more would be reserved at once, whatever there is to read
        except OSError as error:
            raise InputError(f"{path}: can't read the {kind}: {error.strerror}") from error


def _open_at_once(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK)  # a named pipe would wait for its other end


def unknown(kind: str, name: object, available: Iterable[object]) -> InputError:
    """The `InputError` of a name that no table holds, listing the names that one does."""
    names = ", ".join(sorted(str(item) for item in available)) or "none"
    return InputError(f"unknown {kind} {str(name)[:80]!r}; available: {names}")
