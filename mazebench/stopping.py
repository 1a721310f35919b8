"""SIGINT and SIGTERM end a command with one line that says how to go on.

The first signal ends a command where it is, but one that keeps its results at the next `check`: after the step or the
chunk that runs. A second signal ends the process at once. While the command's modules are imported, the first does.
"""

from __future__ import annotations

import contextlib
import os
import shlex
import signal
import sys
from collections.abc import Callable, Iterator

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class Stopped(BaseException):
    """A signal asked the process to end. No handler of `Exception` catches it."""


_asked: int | None = None  # the signal that arrived
_waits = False  # whether it waits for `check`


@contextlib.contextmanager
def listening() -> Iterator[None]:
    """Handles SIGINT and SIGTERM in the block, but not one that is ignored, as SIGINT is in the background."""
    global _asked
    before = {
        number: signal.signal(number, _handle) for number in _SIGNALS if signal.getsignal(number) != signal.SIG_IGN
    }
    try:
        yield
    finally:
        _asked = None
        for number, handler in before.items():
            if signal.getsignal(number) != signal.SIG_IGN:  # `finish` was not called
                signal.signal(number, handler)


def finish() -> None:
    """Has a command that is done end with its status, whatever signals arrive from here on."""
    for number in _SIGNALS:
        if signal.getsignal(number) is _handle:
            signal.signal(number, signal.SIG_IGN)


def _handle(number: int, frame: object) -> None:
    global _asked
    _asked = number
    for each in _SIGNALS:
        if signal.getsignal(each) is _handle:
            signal.signal(each, signal.SIG_DFL)
    if not _waits:
        raise Stopped


def is_asked() -> bool:
    """Returns whether a signal asked the process to end."""
    return _asked is not None


def check() -> None:
    """Raises `Stopped` if a signal asked the process to end."""
    if is_asked():
        raise Stopped


@contextlib.contextmanager
def stoppable(how_to_go_on: Callable[[], tuple[str, ...]], waits: bool = False) -> Iterator[None]:
    """Ends the command with one line if a signal stops the block, also where something else fails because of it.

    Args:
      how_to_go_on: returns what is kept, in words, and the options with which the same command goes on.
      waits: whether a signal waits for the next `check`.
    """
    global _waits
    before, _waits = _waits, waits
    try:
        yield
    except (Stopped, Exception):
        if _asked is None:
            raise
        _say(_asked, *how_to_go_on())
        sys.exit(128 + _asked)
    finally:
        _waits = before


def _say(number: int, kept: str, *options: str) -> None:
    words = ["mazebench", *sys.argv[1:], *(option for option in options if option not in sys.argv)]
    event = "interrupted" if number == signal.SIGINT else "terminated"
    print(f"mazebench: {event}; {kept} with: {shlex.join(words)}", file=sys.stderr, flush=True)


def _end_at_once(number: int, frame: object) -> None:
    _say(number, "run it again")
    os._exit(128 + number)


# The command imports this module before any other. Elsewhere, importing it does nothing. `python -m mazebench` has its
# own word in `sys.argv` only later.
if [os.path.basename(word) for word in sys.orig_argv[-len(sys.argv) :][:1]] == ["mazebench"]:
    for _number in _SIGNALS:
        if signal.getsignal(_number) != signal.SIG_IGN:
            signal.signal(_number, _end_at_once)
