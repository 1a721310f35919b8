"""One sitting of a training run: what is done of it, how fast it goes, and how long the rest takes."""

from __future__ import annotations

import collections
import dataclasses
import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

from mazebench.training.counters import Counters

_WINDOW = 60.0  # s, over which speeds and losses are averaged
_BETWEEN_MARKS = 1.0  # s


@dataclasses.dataclass(frozen=True)
class Status:
    """How a sitting is doing; speeds and losses are those of the last minute."""

    env_steps: int  # of the run
    updates: int  # of the run
    share: float  # of the sitting, or of all steps of the run, that is done, from 0 to 1: of what ends first
    is_timed: bool  # whether `share` is of the sitting
    seconds_left: float | None  # of the sitting; None while no speed is known
    steps_per_second: float
    updates_per_second: float
    losses: Mapping[str, float]  # means over updates, by name; empty if there was none
    evaluated: tuple[int, int] | None = None  # held-out episodes that have ended, and all; None unless evaluating

    @property
    def summary(self) -> str:
        """Steps, updates and speeds in words."""
        return (
            f"{self.env_steps:,} steps of the run, {self.updates:,} updates, "
            f"{self.steps_per_second:,.0f} steps/s, {self.updates_per_second:.1f} updates/s"
        )


# Called with the status after each step.
Progress = Callable[[Status], None]


def in_words(values: Mapping[str, float]) -> str:
    """Returns names and values in one line."""
    return ", ".join(f"{name} {value:.3g}" for name, value in values.items())


class _Mark(NamedTuple):
    """Where the run was at a time, and the sums over all updates of the sitting until then."""

    time: float  # s
    counters: Counters
    sums: Mapping[str, float]


class Sitting:
    """Measures a sitting that ends after so many minutes, or when the run has so many steps, whatever is first."""

    def __init__(
        self,
        minutes: float | None,
        env_steps: int | None,
        counters: Counters,
        clock: Callable[[], float] = time.monotonic,
    ):
        """The sitting begins now, with a run that is at `counters`; `clock` returns seconds."""
        self._seconds = None if minutes is None else 60 * minutes
        self._env_steps = env_steps
        self._clock = clock
        self._begin = clock()
        self._sums: dict[str, float] = {}
        self._marks = collections.deque([_Mark(self._begin, counters, {})])

    def add_update(self, values: Mapping[str, float]) -> None:
        """Adds what an update returned."""
        for name, value in values.items():
            self._sums[name] = self._sums.get(name, 0.0) + value

    def share_done(self, counters: Counters) -> float:
        """Returns the share of the time, or of the steps, that is up when the run is at `counters`, from 0 to 1."""
        return min(1.0, max(self._shares_done(counters)))

    def _shares_done(self, counters: Counters) -> tuple[float, float]:
        """Returns the shares of the sitting's time and of the run's steps."""
        of_time = 0.0 if self._seconds is None else (self._clock() - self._begin) / self._seconds
        return of_time, 0.0 if self._env_steps is None else counters.env_steps / self._env_steps

    def status(self, counters: Counters, evaluated: tuple[int, int] | None = None) -> Status:
        """Returns how the sitting is doing, with the run at `counters`."""
        now = self._clock()
        while len(self._marks) > 1 and self._marks[1].time <= now - _WINDOW:
            self._marks.popleft()
        first = self._marks[0]
        if now >= self._marks[-1].time + _BETWEEN_MARKS:
            self._marks.append(_Mark(now, counters, dict(self._sums)))
        elapsed, updates = now - first.time, counters.updates - first.counters.updates
        steps_per_second = (counters.env_steps - first.counters.env_steps) / elapsed if elapsed else 0.0
        of_time, of_steps = self._shares_done(counters)
        return Status(
            counters.env_steps,
            counters.updates,
            min(1.0, max(of_time, of_steps)),
            self._seconds is not None and of_time >= of_steps,
            self._seconds_left(now, counters, steps_per_second),
            steps_per_second,
            updates / elapsed if elapsed else 0.0,
            {name: (value - first.sums.get(name, 0.0)) / updates for name, value in self._sums.items() if updates},
            evaluated,
        )

    def _seconds_left(self, now: float, counters: Counters, steps_per_second: float) -> float | None:
        left = []
        if self._seconds is not None:
            left.append(self._begin + self._seconds - now)
        if self._env_steps is not None and steps_per_second:
            left.append((self._env_steps - counters.env_steps) / steps_per_second)
        return max(0.0, min(left)) if left else None
