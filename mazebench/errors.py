"""The errors that the command line prints as one line: of bad input (exit status 2) and of failed runs (1)."""

from __future__ import annotations

import sys
from collections.abc import Iterable


class InputError(ValueError):
    """Bad input from a user; the message says what was expected and what was found, in one line."""

    def __init__(self, message: str):
        """Escapes what does not print in `message`, such as line ends in names of files."""
        super().__init__(one_line(message))


class RunError(RuntimeError):
    """A failure of a run whose input was good; the message says what happened and what is kept."""


def one_line(text: str) -> str:
    """Returns `text` with characters escaped that do not print, such as line ends and commands to a terminal."""
    return "".join(letter if letter.isprintable() else letter.encode("unicode_escape").decode() for letter in text)


def unknown(kind: str, name: object, available: Iterable[object]) -> InputError:
    """Returns the error of an unknown name, which lists the known ones."""
    names = ", ".join(sorted(str(item) for item in available)) or "none"
    return InputError(f"unknown {kind} {str(name)[:80]!r}; available: {names}")


def remark(line: str) -> None:
    """Prints a line for the user beside the output, on stderr."""
    print(f"mazebench: {one_line(line)}", file=sys.stderr)
