"""Turns SIGINT and SIGTERM into exceptions, and ends a command that they stop with one line."""

from __future__ import annotations

import atexit
import contextlib
import shlex
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from typing import Any, NoReturn


class Terminated(BaseException):
    """SIGTERM asked the process to end. No handler of `Exception` catches it."""


_EXCEPTIONS: dict[int, type[BaseException]] = {signal.SIGINT: KeyboardInterrupt, signal.SIGTERM: Terminated}
_raised: list[type[BaseException]] = []  # by signals, in order


@contextlib.contextmanager
def listening() -> Iterator[None]:
    """Turns SIGINT and SIGTERM into exceptions; SIGINT only where it is not ignored, as it is in the background."""
    heeded = [number for number in _EXCEPTIONS if signal.getsignal(number) != signal.SIG_IGN]
    with handling(heeded, _raise):
        try:
            yield
        finally:
            _raised.clear()


@contextlib.contextmanager
def handling(numbers: Iterable[int], handler: Callable[[int, Any], None]) -> Iterator[None]:
    """Installs a handler of some signals for the block; only the main thread may."""
    before = {number: signal.signal(number, handler) for number in numbers}
    try:
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)


@contextlib.contextmanager
def postponing() -> Iterator[None]:
    """Under `listening`, lets the first signal in the block wait for the next `check`; a second one raises at once."""
    heeded = [number for number in _EXCEPTIONS if signal.getsignal(number) is _raise]
    with handling(heeded, _raise_later):
        yield


def is_asked() -> bool:
    """Returns whether the next `check` will raise."""
    return bool(_raised)


def check() -> None:
    """Raises what a signal raised before, or what waits; loops call it, since libraries' callbacks lose exceptions."""
    if _raised:
        raise _raised[0]


@contextlib.contextmanager
def stoppable(how_to_go_on: Callable[[], tuple[str, ...]]) -> Iterator[None]:
    """Ends the command with one line if a signal arrived, even if another exception came of it.

    Args:
      how_to_go_on: returns what is kept, in words, and the options with which the same command goes on.
    """
    try:
        yield
    except (KeyboardInterrupt, Terminated) as stop:
        _end(type(stop), *how_to_go_on())
    except Exception:
        if _raised:
            _end(_raised[0], *how_to_go_on())
        raise


def _raise(number: int, frame: object) -> NoReturn:
    _raised.append(_EXCEPTIONS[number])
    raise _EXCEPTIONS[number]


def _raise_later(number: int, frame: object) -> None:
    if _raised:
        _raise(number, frame)
    _raised.append(_EXCEPTIONS[number])


def _end(kind: type[BaseException], kept: str, *options: str) -> NoReturn:
    words = ["mazebench", *sys.argv[1:], *(option for option in options if option not in sys.argv)]
    event, status = ("terminated", 143) if kind is Terminated else ("interrupted", 130)
    atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)  # libraries end noisily where one more arrives
    print(f"mazebench: {event}; {kept} with: {shlex.join(words)}", file=sys.stderr)
    sys.exit(status)
