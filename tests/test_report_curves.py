"""Learning curves of training runs: made-up run folders, what is drawn of them, what is refused."""

from __future__ import annotations

import json

import pytest
from made_results import make_result

from mazebench.errors import InputError, Remark
from mazebench.report.curves import find_runs, write_learning_curves

LINES = (
    {"env_steps": 500, "updates": 1, "td_loss": 3.0},  # between milestones: no success rates
    {"env_steps": 1000, "updates": 3, "td_loss": 2.0, "q": -1.0, "success_rate_2": 0.25, "success_rate_10": 0.0},
    {"env_steps": 1500, "updates": 5, "td_loss": 1.0},
    {"env_steps": 2000, "updates": 7, "td_loss": 0.5, "success_rate_2": 0.75, "success_rate_10": 0.5},
)


def make_run(folder, lines=LINES, agent="mah"):
    """Writes a training run's folder."""
    (folder / "checkpoints").mkdir(parents=True)
    (folder / "config.json").write_text(json.dumps({"agent": agent, "seed": 3}))
    (folder / "metrics.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    return folder


def report(out, *paths):
    """The document over all runs below some paths."""
    write_learning_curves(find_runs(paths), out)
    return (out / "report.md").read_text()


def test_a_run_has_figures_and_a_row(tmp_path):
    text = report(tmp_path / "out", make_run(tmp_path / "mah-3"))
    head, _, row = (line for line in text.splitlines() if line.startswith("|"))
    assert head == "| run | agent | seed | agent steps | updates | success, 2 | success, 10 |"
    assert row == "| mah-3 | mah | 3 | 2,000 | 7 | 0.750 | 0.500 |"
    files = {path.name for path in (tmp_path / "out" / "figures").iterdir()}
    assert files == {"success.png", "success.pdf", "losses.png", "losses.pdf"}
    assert all(f"](figures/{name}.png)" in text for name in ("success", "losses"))


def test_several_runs_below_a_folder_stand_side_by_side(tmp_path):
    for name in ("seed-0", "more/seed-1"):
        make_run(tmp_path / "runs" / name)
    text = report(tmp_path / "out", tmp_path / "runs", tmp_path / "runs" / "seed-0")
    assert [line.split(" | ")[0] for line in text.splitlines()[4:6]] == ["| more/seed-1", "| seed-0"]


def test_a_line_that_is_being_written_is_left_out(tmp_path):
    with (make_run(tmp_path / "run") / "metrics.jsonl").open("a") as file:
        file.write('{"env_steps":2500,"upd')
    assert "| 2,000 | 7 |" in report(tmp_path / "out", tmp_path / "run")


def test_a_run_that_logged_nothing_is_skipped(tmp_path):
    make_run(tmp_path / "runs" / "new", lines=())
    skipped = f"{tmp_path / 'runs' / 'new'}: expected a training run with metrics, found none yet; skipped"
    with (
        pytest.warns(Remark, match=f"^{skipped}$"),
        pytest.raises(InputError, match="expected training runs with metrics, found none"),
    ):
        write_learning_curves(find_runs([tmp_path]), tmp_path / "out")


def test_the_command_draws_training_runs_where_there_are_no_results(tmp_path, command):
    make_run(tmp_path / "all" / "run")
    out = tmp_path / "out"
    assert command("report", tmp_path / "all", "--out", out) == (0, f"1 training run: {out / 'report.md'}\n", "")
    make_result(tmp_path / "all" / "result", "mah", num_mazes=1, record=False)
    status, output, errors = command("report", tmp_path / "all", "--out", tmp_path / "other")
    assert (status, output.partition(":")[0]) == (0, "1 result of mah")
    assert errors == "mazebench: 1 training run left out beside results; report them by themselves\n"
