"""What a training run says of itself while it goes on: the share that is done, speeds, losses, and the end."""

from __future__ import annotations

import datetime
from typing import Any

import pytest

from mazebench.commands.progress import StatusLines, describe
from mazebench.training.counters import BEGINNING
from mazebench.training.sitting import Sitting, Status


class Clock:
    """Seconds that pass when the test says so."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


def played(clock: Clock, sitting: Sitting, steps_per_second: int, seconds: int, counters=BEGINNING, loss=1.0):
    """Plays for some seconds, with a status a second and an update every other second; returns the counters."""
    for second in range(1, seconds + 1):
        clock.now += 1
        counters = counters.after_steps(steps_per_second)
        if second % 2 == 0:
            counters = counters.after_update({"loss": loss})
            sitting.add_update({"loss": loss})
        sitting.status(counters)
    return counters


def test_a_sitting_of_minutes_ends_by_the_clock():
    clock = Clock()
    sitting = Sitting(2.0, None, BEGINNING, clock)
    counters = played(clock, sitting, 100, seconds=30)
    status = sitting.status(counters)
    assert (status.share, status.seconds_left) == (0.25, 90)
    assert (status.steps_per_second, status.updates_per_second, status.losses) == (100, 0.5, {"loss": 1.0})


def test_a_sitting_of_steps_ends_when_they_are_taken_at_the_speed_of_the_last_minute():
    clock = Clock()
    sitting = Sitting(None, 100_000, BEGINNING, clock)
    counters = played(clock, sitting, 1000, seconds=50)
    assert sitting.status(counters).seconds_left == 50
    counters = played(clock, sitting, 100, 60, counters, loss=3.0)
    status = sitting.status(counters)
    assert (status.steps_per_second, status.seconds_left, status.losses) == (100, (100_000 - 56_000) / 100, {"loss": 3})


def test_steps_of_earlier_sittings_count_for_the_share_but_not_for_the_speed():
    clock = Clock()
    before = BEGINNING.after_steps(50_000)
    sitting = Sitting(60.0, 100_000, before, clock)
    status = sitting.status(played(clock, sitting, 1000, 10, before))
    assert (status.share, status.steps_per_second, status.seconds_left) == (0.6, 1000, 40)
    assert not status.is_timed


def test_a_sitting_of_a_resumed_run_begins_at_nothing_where_minutes_end_it():
    clock = Clock()
    before = BEGINNING.after_steps(50_000)
    sitting = Sitting(2.0, None, before, clock)
    status = sitting.status(played(clock, sitting, 1000, 30, before))
    assert (status.share, status.is_timed, status.env_steps) == (0.25, True, 80_000)


def test_no_end_is_known_before_the_first_step_of_a_sitting_of_steps():
    status = Sitting(None, 1000, BEGINNING, Clock()).status(BEGINNING)
    assert (status.share, status.seconds_left, status.losses) == (0.0, None, {})


NOW = datetime.datetime(2026, 11, 22, 22, 30)
STATUS: dict[str, Any] = {
    "env_steps": 90_112,
    "updates": 273,
    "share": 0.45,
    "is_timed": True,
    "seconds_left": 312.0,
    "steps_per_second": 654.3,
    "updates_per_second": 2.56,
    "losses": {"td_loss": 0.0123},
}


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        (
            {},
            "45% of this sitting done; 6 min left, until 22:35; 90,112 steps of the run, "
            "273 updates, 654 steps/s, 2.6 updates/s; td_loss 0.0123",
        ),
        ({"seconds_left": 40.0}, "45% of this sitting done; 40 s left, until 22:30; "),
        ({"seconds_left": 7200.0}, "45% of this sitting done; 2 h 0 min left, until 2026-11-23 00:30; "),
        ({"seconds_left": None}, "45% of this sitting done; 90,112 steps of the run"),
        ({"is_timed": False}, "45% of the run done; 6 min left"),
        ({"updates": 0, "losses": {}}, "; collecting before learning begins"),
        ({"evaluated": (50, 1200)}, "; evaluating: 50 of 1,200 held-out episodes"),
    ],
)
def test_a_status_says_how_much_is_done_and_when_it_ends(changes: dict[str, Any], line: str):
    assert line in describe(Status(**STATUS | changes), NOW)


def test_where_nothing_is_a_terminal_there_are_two_lines_a_minute_however_many_statuses(capsys):
    clock = Clock()
    lines = StatusLines(clock)
    for _ in range(600):
        clock.now += 0.1
        lines(Status(**STATUS))
    printed = capsys.readouterr().out.splitlines()
    assert 2 <= len(printed) <= 4
    assert all("45% of this sitting done; 6 min left, until " in line for line in printed)


def test_a_line_of_a_milestone_is_printed_at_once_and_puts_off_the_next_status(capsys):
    clock = Clock()
    lines = StatusLines(clock)
    clock.now += 19
    lines.say("200,000 steps")
    clock.now += 19
    lines(Status(**STATUS))
    assert capsys.readouterr().out == "200,000 steps\n"
