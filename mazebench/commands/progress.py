"""Progress display for long commands: a bar on a terminal, lines elsewhere."""

from __future__ import annotations

import dataclasses
import datetime
import logging
import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from mazebench.training.status import Progress, Status, in_words

_SECONDS_BETWEEN_LINES = 20  # so that there are two a minute even if steps take seconds


@dataclasses.dataclass
class Kept:
    """The number of episodes on disk, and of all."""

    ended: int = 0
    of: int | None = None  # None before the first is run

    def __str__(self) -> str:
        return "no episode has ended" if self.of is None else f"{self.ended:,} of {self.of:,} episodes are kept"


@contextmanager
def evaluating(title: str, kept: Kept) -> Iterator[Callable[[int, int], None]]:
    """Yields a function (ended, of) that updates `kept` and shows it."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeElapsedColumn, TimeRemainingColumn

    console = Console(stderr=True)
    columns = (BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal) as bar:
        task = bar.add_task(title, total=None)
        tenths_seen = -1

        def advance(ended: int, of: int) -> None:
            nonlocal tenths_seen
            kept.ended, kept.of = ended, of
            bar.update(task, completed=ended, total=of)
            tenth = 10 * ended // max(of, 1)
            if not console.is_terminal and tenth > tenths_seen:
                tenths_seen = tenth
                with suppress(OSError):  # nobody reads it any more
                    print(f"{title}: {ended:,} of {of:,} episodes", file=sys.stderr, flush=True)

        if console.is_terminal:
            console.print(title, markup=False, highlight=False)  # names of agents would leave the bar no room
        yield advance


@contextmanager
def training() -> Iterator[Progress]:
    """Yields a function that shows the status, and prints what a training logs.

    On a terminal, the status stands below these lines; elsewhere it is printed now and then.
    """
    from rich.console import Console
    from rich.live import Live
    from rich.progress_bar import ProgressBar
    from rich.table import Table
    from rich.text import Text

    console = Console()
    if not console.is_terminal:
        lines = StatusLines()
        with _logged(lines.say):
            yield lines
        return
    with Live(console=console) as live:

        def say(line: str) -> None:
            live.console.print(line, markup=False, highlight=False)

        def show(status: Status) -> None:
            shown = Table.grid()
            shown.add_row(ProgressBar(total=1.0, completed=status.share))
            shown.add_row(Text(describe(status)))
            live.update(shown)

        with _logged(say):
            yield show


@contextmanager
def _logged(say: Callable[[str], None]) -> Iterator[None]:
    """Gives `say` what the training logs in the block; warnings go to standard error."""
    logger, handler = logging.getLogger("mazebench.training"), _Lines(say)
    level, propagates = logger.level, logger.propagate
    logger.setLevel(logging.INFO)
    logger.propagate = False  # an agent's module may have configured the root logger
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.propagate = propagates
        logger.setLevel(level)


class _Lines(logging.Handler):
    """Gives each message to a function, but warnings to standard error."""

    def __init__(self, say: Callable[[str], None]):
        super().__init__()
        self._say = say

    def emit(self, record: logging.LogRecord) -> None:
        if record.levelno >= logging.WARNING:
            print(f"mazebench: {record.getMessage()}", file=sys.stderr)
        else:
            self._say(record.getMessage())


class StatusLines:
    """Prints lines, and between them the status, at most `_SECONDS_BETWEEN_LINES` after the line before."""

    def __init__(self, clock: Callable[[], float] = time.monotonic):
        """`clock` returns seconds."""
        self._clock = clock
        self._printed = clock()

    def __call__(self, status: Status) -> None:
        """Prints the status, if it is time."""
        if self._clock() >= self._printed + _SECONDS_BETWEEN_LINES:
            self.say(f"{datetime.datetime.now():%H:%M:%S} {describe(status)}")

    def say(self, line: str) -> None:
        """Prints a line at once."""
        print(line, flush=True)
        self._printed = self._clock()


def describe(status: Status) -> str:
    """Returns a status in words."""
    parts = [f"{status.share:.0%} done"]
    if status.seconds_left is not None:
        parts.append(f"{datetime.timedelta(seconds=math.ceil(status.seconds_left))} left")
    parts.append(status.summary)
    if status.evaluated is not None:
        ended, of = status.evaluated
        parts.append(f"evaluating: {ended:,} of {of:,} held-out episodes")
    elif status.losses:
        parts.append(in_words(status.losses))
    elif not status.updates:
        parts.append("collecting before learning begins")
    return "; ".join(parts)
