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
    """How many episodes are on disk."""

    ended: int = 0
    of: int | None = None  # None before the first is run

    def __str__(self) -> str:
        return "no episode has ended" if self.of is None else f"{self.ended:,} of {self.of:,} episodes are kept"


@contextmanager
def evaluating(title: str, kept: Kept) -> Iterator[Callable[[int, int], None]]:
    """Yields a function (ended, of) that updates `kept` and shows it."""
    with _episodes_shown(title) as show:

        def advance(ended: int, of: int) -> None:
            kept.ended, kept.of = ended, of
            show(ended, of)

        yield advance


@contextmanager
def _episodes_shown(title: str) -> Iterator[Callable[[int, int], None]]:
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    from rich.table import Column

    console = Console(stderr=True)
    if not console.is_terminal:
        tenths_seen = [-1]

        def say(done: int, of: int) -> None:
            tenth = 10 * done // max(of, 1)
            if tenth > tenths_seen[0]:
                tenths_seen[0] = tenth
                with suppress(OSError):  # nobody reads it any more
                    print(f"{title}: {done:,} of {of:,} episodes", file=sys.stderr, flush=True)

        yield say
        return
    console.print(title, markup=False, highlight=False)  # names of agents would leave the bar no room in its line
    whole = Column(no_wrap=True)  # where the terminal is narrow, the bar is cut, not the numbers
    columns = (
        BarColumn(None, table_column=Column(ratio=1)),
        *(column(table_column=whole) for column in (MofNCompleteColumn, TimeElapsedColumn, TimeRemainingColumn)),
    )
    with Progress(*columns, console=console, expand=True) as bar:
        task = bar.add_task("", total=None)
        yield lambda done, of: bar.update(task, completed=done, total=of)


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
        with _logged("mazebench.training", lines.say):
            yield lines
        return
    with Live(console=console) as live:

        def say(line: str) -> None:
            live.console.print(line, markup=False, highlight=False)

        def show(status: Status) -> None:
            shown = Table.grid()
            shown.add_row(ProgressBar(total=1.0, completed=status.share))
            shown.add_row(Text(describe(status, datetime.datetime.now())))
            live.update(shown)

        with _logged("mazebench.training", say):
            yield show


@contextmanager
def _logged(name: str, say: Callable[[str], None]) -> Iterator[None]:
    """Gives `say` what the logger called `name` logs in the block; warnings go to standard error."""
    logger, handler = logging.getLogger(name), _Lines(say)
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
            now = datetime.datetime.now()
            self.say(f"{now:%H:%M:%S} {describe(status, now)}")

    def say(self, line: str) -> None:
        """Prints a line at once."""
        print(line, flush=True)
        self._printed = self._clock()


def describe(status: Status, now: datetime.datetime) -> str:
    """Returns a status in words; `now` is the local time."""
    parts = [f"{status.share:.0%} done"]
    if status.seconds_left is not None:
        end = now + datetime.timedelta(seconds=status.seconds_left)
        day = "" if end.date() == now.date() else f"{end:%Y-%m-%d} "
        parts.append(f"{_duration(status.seconds_left)} left, until {day}{end:%H:%M}")
    parts.append(status.summary)
    if status.evaluated is not None:
        ended, of = status.evaluated
        parts.append(f"evaluating: {ended:,} of {of:,} held-out episodes")
    elif status.losses:
        parts.append(in_words(status.losses))
    elif not status.updates:
        parts.append("collecting before learning begins")
    return "; ".join(parts)


def _duration(seconds: float) -> str:
    minutes = math.ceil(seconds / 60)
    if minutes <= 1:
        return f"{math.ceil(seconds)} s"
    return f"{minutes} min" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"
