"""The progress of a training run, its speed, and the time that is left."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Mapping

from mazebench.training.counters import Counters


@dataclasses.dataclass(frozen=True)
class Status:
    """The progress of a run in steps and updates."""

    env_steps: int
    updates: int
    share: float  # of the time or of the steps that is done, from 0 to 1: of what ends first
    seconds_left: float | None  # None while no speed is known
    steps_per_second: float  # since the command began
    losses: Mapping[str, float]  # means over the updates since the last line of metrics, by name
    evaluated: tuple[int, int] | None = None  # held-out episodes that have ended, and all; None unless evaluating

    @property
    def summary(self) -> str:
        """Steps, updates and speed in words."""
        return f"{self.env_steps:,} steps of the run, {self.updates:,} updates, {self.steps_per_second:,.0f} steps/s"


# Called with the status after each step.
Progress = Callable[[Status], None]


def in_words(values: Mapping[str, float]) -> str:
    """Returns names and values in one line."""
    return ", ".join(f"{name} {value:.3g}" for name, value in values.items())


class Timer:
    """Tells when a command ends: after so many minutes, or when the run has so many steps, whatever is first."""

    def __init__(
        self,
        minutes: float | None,
        env_steps: int | None,
        counters: Counters,
        clock: Callable[[], float] = time.monotonic,
    ):
        """The command begins now, with a run that is at `counters`; `clock` returns seconds."""
        self._seconds, self._env_steps = None if minutes is None else 60 * minutes, env_steps
        self._clock, self._begin, self._steps_before = clock, clock(), counters.env_steps

    def share_done(self, counters: Counters) -> float:
        """Returns the share of the time, or of the steps, that is up when the run is at `counters`, from 0 to 1."""
        of_time = 0.0 if self._seconds is None else (self._clock() - self._begin) / self._seconds
        of_steps = 0.0 if self._env_steps is None else counters.env_steps / self._env_steps
        return min(1.0, max(of_time, of_steps))

    def status(self, counters: Counters, evaluated: tuple[int, int] | None = None) -> Status:
        """Returns how far the run is at `counters`."""
        elapsed = self._clock() - self._begin
        speed = (counters.env_steps - self._steps_before) / elapsed if elapsed else 0.0
        left = [] if self._seconds is None else [self._seconds - elapsed]
        if self._env_steps is not None and speed:
            left.append((self._env_steps - counters.env_steps) / speed)
        return Status(
            counters.env_steps,
            counters.updates,
            self.share_done(counters),
            max(0.0, min(left)) if left else None,
            speed,
            counters.mean_losses(),
            evaluated,
        )
