"""The errors that the command line prints as one line: of bad input (exit status 2) and of failed runs (1)."""

from __future__ import annotations

import pathlib


class InputError(ValueError):
    """What a user gave can't be used; the message says what was expected and what was found."""


class RunError(RuntimeError):
    """A run that was well asked for can't go on; the message says what happened and what is kept."""


def read_at_most(path: pathlib.Path, num_bytes: int, kind: str) -> bytes:
    """The content of a file from outside, cut off one byte after `num_bytes`, so that the caller sees if it is larger.

    Raises:
      InputError: if it can't be read; the message calls it a `kind`.
    """
    try:
        with path.open("rb") as file:
            return file.read(num_bytes + 1)
    except OSError as error:
        raise InputError(f"{path}: can't read the {kind}: {error.strerror}") from error


def unknown(kind: str, name: object, available) -> InputError:
    """The `InputError` of a name that no table holds, listing the names that one does."""
    names = ", ".join(sorted(str(item) for item in available)) or "none"
    return InputError(f"unknown {kind} {str(name)[:80]!r}; available: {names}")
