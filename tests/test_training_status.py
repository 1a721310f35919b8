"""The status of a training run: the share that is done, the speed, losses, and the end."""

from __future__ import annotations

from typing import Any

import pytest

from mazebench.commands.progress import StatusLines, describe
from mazebench.training.counters import Counters
from mazebench.training.status import Status, Timer


class Clock:
    """Seconds that pass when the test says so."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


@pytest.mark.parametrize(
    ("minutes", "env_steps", "share", "seconds_left"),
    [(2.0, None, 0.25, 90), (None, 100_000, 0.8, 20), (60.0, 100_000, 0.8, 20), (1.0, 1_000_000, 0.5, 30)],
)
def test_a_command_ends_by_the_clock_or_when_the_run_has_its_steps(minutes, env_steps, share, seconds_left):
    clock, before = Clock(), Counters(env_steps=50_000)  # steps of earlier commands count for the share, not the speed
    timer = Timer(minutes, env_steps, before, clock)
    clock.now += 30
    status = timer.status(before.after_steps(30_000).after_update({"loss": 1.0}).after_update({"loss": 3.0}))
    assert (status.share, status.seconds_left, status.steps_per_second) == (share, seconds_left, 1000)
    assert (status.env_steps, status.updates, status.losses) == (80_000, 2, {"loss": 2.0})


def test_no_end_is_known_before_the_first_step_of_a_command_that_has_steps_to_take():
    status = Timer(None, 1000, Counters(), Clock()).status(Counters())
    assert (status.share, status.seconds_left, status.losses) == (0.0, None, {})


STATUS: dict[str, Any] = {
    "env_steps": 90_112,
    "updates": 273,
    "share": 0.45,
    "seconds_left": 312.0,
    "steps_per_second": 654.3,
    "losses": {"td_loss": 0.0123},
}


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({}, "45% done; 0:05:12 left; 90,112 steps of the run, 273 updates, 654 steps/s; td_loss 0.0123"),
        ({"seconds_left": None}, "45% done; 90,112 steps of the run"),
        ({"updates": 0, "losses": {}}, "; collecting before learning begins"),
        ({"evaluated": (50, 1200)}, "; evaluating: 50 of 1,200 held-out episodes"),
    ],
)
def test_a_status_says_how_much_is_done_and_when_it_ends(changes: dict[str, Any], line: str):
    assert line in describe(Status(**STATUS | changes))


def test_where_nothing_is_a_terminal_there_are_two_lines_a_minute_besides_those_of_milestones(capsys):
    clock = Clock()
    lines = StatusLines(clock)
    for _ in range(600):
        clock.now += 0.1
        lines(Status(**STATUS))
    printed = capsys.readouterr().out.splitlines()
    assert 2 <= len(printed) <= 4
    assert all("45% done; 0:05:12 left; " in line for line in printed)
    lines.say("200,000 steps")
    clock.now += 19
    lines(Status(**STATUS))
    assert capsys.readouterr().out == "200,000 steps\n"


def test_losses_are_means_over_the_updates_that_have_them():
    counters = Counters().after_update({"loss": 1.0, "success": 0.5}).after_update({"success": 0.0})
    assert counters.after_update({"loss": 3.0, "success": 1.0}).mean_losses() == {"loss": 2.0, "success": 0.5}
    assert counters.after_line().mean_losses() == {}
