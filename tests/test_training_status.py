"""What a training and an evaluation show of how far they are."""

from __future__ import annotations

import pytest

from mazebench.commands import progress
from mazebench.training.counters import Counters
from mazebench.training.loop import Status

COUNTERS = Counters(env_steps=90_112).after_update({"td_loss": 0.01}).after_update({"td_loss": 0.02})


@pytest.mark.parametrize(
    ("status", "words"),
    [
        (Status(Counters(), 0.0, 0.0), "0 steps/s; collecting before learning begins"),
        (Status(COUNTERS, 1.0, 9.0, (50, 1200)), "9 steps/s; evaluating: 50 of 1,200 held-out episodes"),
    ],
)
def test_a_status_says_what_the_run_does(status: Status, words: str):
    assert str(status).endswith(words)


def test_where_nothing_is_a_terminal_there_is_a_line_now_and_then(capsys):
    with progress.training() as show:
        for tenth in range(100):
            show(Status(COUNTERS, 0.25 + tenth / 2400, 9.0))
    (line,) = capsys.readouterr().out.splitlines()
    assert " 25% done; 90,112 steps of the run, 2 updates, 9 steps/s; td_loss 0.015" in line


def test_an_evaluation_counts_its_episodes(capsys):
    kept = progress.Kept()
    with progress.evaluating("dqn, local", kept) as show:
        show(10, 1500)
    assert capsys.readouterr().err == "dqn, local: 10 of 1,500 episodes\n"
    assert str(kept) == "10 of 1,500 episodes are kept"


def test_losses_are_means_over_the_updates_that_have_them():
    counters = Counters().after_update({"loss": 1.0, "success": 0.5}).after_update({"success": 0.0})
    assert counters.after_update({"loss": 3.0, "success": 1.0}).mean_losses() == {"loss": 2.0, "success": 0.5}
    assert counters.after_line().mean_losses() == {}
