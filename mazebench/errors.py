"""Errors of bad input (exit status 2) and of failed runs (1), and remarks: the command line prints each as one line."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pydantic


class InputError(ValueError):
    """Bad input from a user; the message says what was expected and what was found, in one line.

        >>> mazebench.make("locl")
        Traceback (most recent call last):
        InputError: unknown task 'locl'; available: adrift, building, hierarchical, local, rebuilt, rough

    The command line prints the line and ends with status 2.
    """

    def __init__(self, message: str):
        """Escapes what does not print in `message`, such as line ends in names of files."""
        super().__init__(one_line(message))


class UnknownOptionError(InputError, TypeError):
    """A call with an option that there is not: a `TypeError` in Python's words, by which other libraries know it."""


class UnplayableError(InputError):
    """An agent can't play in the environments that it is to be built for. A suite leaves such a task out.

        >>> raise mazebench.UnplayableError("expected contexts of 13 x 13, found 31 x 31")

    An agent raises it in `build`.
    """


class RunError(RuntimeError):
    """A failure of a run whose input was good; the message says what happened and what is kept."""


class Remark(UserWarning):
    """A warning that tells a user in one line what was done with good input, such as a map that was padded."""


def remark(line: str) -> None:
    """Warns of something with a `Remark`."""
    warnings.warn(one_line(line), Remark, stacklevel=2)


@contextlib.contextmanager
def remarks_to(show: Callable[[str], object]) -> Iterator[None]:
    """Gives `show` each remark of the block; other warnings are shown as ever."""
    with warnings.catch_warnings():
        show_other = warnings.showwarning

        def show_warning(message: Warning | str, category: type[Warning], *where: Any, **source: Any) -> None:
            if issubclass(category, Remark):
                show(str(message))
            else:
                show_other(message, category, *where, **source)

        warnings.simplefilter("always", Remark)
        warnings.showwarning = show_warning
        yield


def one_line(text: str) -> str:
    """Returns `text` with characters escaped that do not print, such as line ends and commands to a terminal."""
    if text.isprintable():
        return text
    return "".join(letter if letter.isprintable() else letter.encode("unicode_escape").decode() for letter in text)


def shortened(text: str, most: int = 300) -> str:
    """Returns `text` in one line of at most `most` characters, and how many were cut."""
    text = " ".join(text.split())
    return text if len(text) <= most else f"{text[:most]}... ({len(text) - most:,} more characters)"


def describe_error(error: BaseException) -> str:
    """Returns the kind and the text of an exception of other people's code, in one line."""
    text = ""
    with contextlib.suppress(Exception, SystemExit, GeneratorExit):  # of a class whose text can't be made
        text = str(error)
    return shortened(f"{type(error).__name__}: {text}").removesuffix(":")


def unknown(kind: str, name: object, available: Iterable[object]) -> InputError:
    """Returns the error of an unknown name, which lists the known ones."""
    names = ", ".join(sorted(str(item) for item in available)) or "none"
    return InputError(f"unknown {kind} {repr(name)[:80]}; available: {names}")


def describe_fault(error: pydantic.ValidationError) -> str:
    """Returns the first fault that a validation found, in words."""
    fault = error.errors(include_url=False)[0]
    where = ".".join(map(str, fault["loc"]))
    found = "" if fault["type"] in ("json_invalid", "missing") else f", found {str(fault['input'])[:60]!r}"
    return f"{where + ': ' if where else ''}{fault['msg']}{found}"
