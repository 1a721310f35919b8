"""Progress display for long commands: a bar on a terminal, lines elsewhere."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress


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
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

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
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console) as bar:
        task = bar.add_task(title, total=None)
        yield lambda done, of: bar.update(task, completed=done, total=of)


@contextmanager
def training() -> Iterator[Callable[[float, str | None], None]]:
    """Yields a function (share, line) that prints the line, on a terminal above a bar of the share."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TimeElapsedColumn

    console = Console()
    if not console.is_terminal:
        yield lambda share, line: None if line is None else print(line, flush=True)
        return
    with Progress(BarColumn(), TaskProgressColumn(), TimeElapsedColumn(), console=console) as bar:
        task = bar.add_task("", total=1.0)

        def show(share: float, line: str | None) -> None:
            bar.update(task, completed=share)
            if line is not None:
                console.print(line, markup=False, highlight=False)

        yield show
