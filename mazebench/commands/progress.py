"""Progress display for long commands: a bar on a terminal, lines elsewhere."""

from __future__ import annotations

import dataclasses
import datetime
import logging
import os
import pathlib
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mazebench.training.loop import Status

_SECONDS_BETWEEN_LINES = 20  # so that there are two a minute even if steps take seconds


@dataclasses.dataclass
class Kept:
    """The number of episodes on disk, and of all."""

    ended: int = 0
    of: int | None = None  # None before the first is run

    def how_to_go_on(self, folder: pathlib.Path, is_named: bool) -> tuple[str, ...]:
        """Returns the words and options for `stopping.stoppable`; `is_named` says that --out names the folder."""
        if self.of is None and not folder.exists():
            return ("nothing was begun; run it again",)
        return (f"{self} in {folder}; go on", *(() if is_named else ("--out", str(folder))), "--resume")

    def __str__(self) -> str:
        return "no episode has ended" if self.of is None else f"{self.ended:,} of {self.of:,} episodes are kept"


def new_folder(name: str) -> pathlib.Path:
    """Returns a folder in results/ for a run that begins now, which the process tells from others."""
    return pathlib.Path("results") / f"{name}-{datetime.datetime.now():%Y%m%d-%H%M%S-%f}-{os.getpid()}"


@contextmanager
def evaluating(title: str, kept: Kept) -> Iterator[Callable[..., None]]:
    """Yields a function (ended, of) that updates `kept` and shows it, or with `sums_up` the oracle's drives."""
    with _showing(title, stderr=True) as show:

        def advance(ended: int, of: int, sums_up: bool = False) -> None:
            if sums_up:
                show(ended, of, f"as a reference, the oracle drove {ended:,} of {of:,} ways")
                return
            kept.ended, kept.of = ended, of
            show(ended, of, f"{ended:,} of {of:,} episodes")

        yield advance


@contextmanager
def training() -> Iterator[Callable[[Status], None]]:
    """Yields a function that shows the status, and prints what a training logs."""
    logger = logging.getLogger("mazebench.training")
    level, propagates = logger.level, logger.propagate
    with _showing("", stderr=False) as show:
        handler = logging.StreamHandler(sys.stdout)  # on a terminal, rich prints its lines above the bar
        logger.addHandler(handler)
        logger.setLevel(logging.INFO)
        logger.propagate = False  # an agent's module may have configured the root logger
        try:
            yield lambda status: show(status.share, 1.0, status)
        finally:
            logger.removeHandler(handler)
            logger.setLevel(level)
            logger.propagate = propagates


@contextmanager
def _showing(title: str, *, stderr: bool) -> Iterator[Callable[[float, float, object], None]]:
    """Yields a function (done, of, status) that shows a bar on a terminal, and elsewhere prints a line now and then."""
    from rich import progress
    from rich.console import Console
    from rich.table import Column

    console = Console(stderr=stderr)
    of_status = progress.TextColumn("{task.description}", markup=False, table_column=Column(no_wrap=False))
    columns = (progress.BarColumn(20), progress.TaskProgressColumn(), progress.TimeRemainingColumn(), of_status)
    with progress.Progress(*columns, console=console, disable=not console.is_terminal) as bar:
        bar.add_task("", total=None)
        (task,) = bar.tasks
        next_line = 0.0

        def show(done: float, of: float, status: object) -> None:
            nonlocal next_line
            bar.update(task.id, completed=done, total=of)
            if console.is_terminal:
                bar.update(task.id, description=str(status))
            elif (now := bar.get_time()) >= next_line or (title and done in (0, of)):
                next_line = now + _SECONDS_BETWEEN_LINES
                left = (
                    "" if task.time_remaining is None else f" {datetime.timedelta(seconds=task.time_remaining)} left;"
                )
                head = f"{title}:" if title else f"{datetime.datetime.now():%H:%M:%S} {done / of:.0%} done;{left}"
                with suppress(OSError):  # nobody reads it any more
                    console.print(f"{head} {status}", markup=False, highlight=False, soft_wrap=True)

        if title and console.is_terminal:
            console.print(title, markup=False, highlight=False)  # names of agents would leave the bar no room
        yield show
