"""The errors that the command line prints as one line: of bad input (exit status 2) and of failed runs (1)."""

from __future__ import annotations

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


def unknown(kind: str, name: object, available: Iterable[object]) -> InputError:
    """The `InputError` of a name that no table holds, listing the names that one does."""
    names = ", ".join(sorted(str(item) for item in available)) or "none"
    return InputError(f"unknown {kind} {str(name)[:80]!r}; available: {names}")
