"""Signals that end a command: remembered, as code in between may lose an exception, and told in one line."""

from __future__ import annotations

import contextlib
import pathlib
import shlex
import shutil
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NoReturn


class Terminated(BaseException):
    """The process was asked to end by SIGTERM; of no kind that anyone below catches."""


_KINDS: dict[int, type[BaseException]] = {signal.SIGINT: KeyboardInterrupt, signal.SIGTERM: Terminated}
_told: list[type[BaseException]] = []


@contextlib.contextmanager
def listening() -> Iterator[None]:
    """Turns SIGINT, unless it is ignored as in the background, and SIGTERM into exceptions."""
    heeded = [number for number in _KINDS if signal.getsignal(number) != signal.SIG_IGN]
    with handling(heeded, _tell):
        try:
            yield
        finally:
            _told.clear()


@contextlib.contextmanager
def handling(numbers: Iterable[int], handler: Callable[[int, Any], None]) -> Iterator[None]:
    """Lets `handler` handle these signals for a while; only the main thread may."""
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)


def _tell(number: int, frame: object) -> NoReturn:
    _told.append(_KINDS[number])
    raise _KINDS[number]


def check() -> None:
    """Raises again what a signal raised in code that lost it, such as a destructor or a compiler's callback."""
    if _told:
        raise _told[0]


@contextlib.contextmanager
def stoppable(say: Callable[[], tuple[str, ...]]) -> Iterator[None]:
    """Ends the command with one line if a signal told it to, whatever came of that inside.

    Args:
      say: gives what is kept, and options with which the same command goes on.
    """
    try:
        yield
    except (KeyboardInterrupt, Terminated) as stop:
        _end(type(stop), *say())
    except Exception:
        if _told:
            _end(_told[0], *say())
        raise


def _end(kind: type[BaseException], kept: str, *options: str) -> NoReturn:
    program = [sys.argv[0]]
    if pathlib.Path(program[0]).name == "__main__.py":
        program = [sys.executable, "-m", "mazebench"]
    elif shutil.which("mazebench") == program[0]:
        program = ["mazebench"]
    words = [*program, *sys.argv[1:], *(option for option in options if option not in sys.argv)]
    said, status = ("terminated", 143) if kind is Terminated else ("interrupted", 130)
    print(f"mazebench: {said}; {kept} with: {shlex.join(words)}", file=sys.stderr)
    sys.exit(status)
