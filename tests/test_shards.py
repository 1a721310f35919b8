"""Shards: merged they give the bytes of one run; what is missing or does not belong together is named."""

from __future__ import annotations

import json
import pathlib
import shutil

import numpy as np
import pytest
from run_folders import results_of, summary_of

from mazebench.evaluation.suites import SUITES, Part
from mazebench.maps.kinds import generate
from mazebench.tasks.task_options import TaskOptions

EVAL = ("eval", "--agent", "planner", "--distances", "1,2", "--episodes-per-distance", "1")
PARTS = (
    Part("near", TaskOptions(distances=(1, 2)), 1),
    Part("legs", TaskOptions(task="hierarchical", landmark_distance=5)),
)


@pytest.fixture(autouse=True)
def _few(monkeypatch):
    monkeypatch.setitem(SUITES, "few", PARTS)


def run(command, *words: str | pathlib.Path) -> str:
    status, output, errors = command(*words)
    assert status == 0, errors
    return output


def merged(command, *words: str | pathlib.Path, of: int = 3) -> pathlib.Path:
    """Runs all shards of a command into a folder and merges them."""
    for number in range(1, of + 1):
        run(command, *words, "--out", "cut", "--shard", f"{number}/{of}")
    run(command, "merge", "cut")
    return pathlib.Path("cut")


def without_shards(folder: pathlib.Path) -> dict[str, bytes]:
    return {name: content for name, content in results_of(folder).items() if not name.startswith("shards/")}


@pytest.fixture
def cut(command) -> pathlib.Path:
    return merged(command, *EVAL, "--record")


def test_an_evaluation_has_the_same_bytes(command, cut, tmp_path):
    shown = run(command, *EVAL, "--record", "--out", "whole").replace("whole", "cut")
    assert without_shards(cut) == results_of(tmp_path / "whole")
    summaries = [summary_of(folder) for folder in (cut, tmp_path / "whole")]
    for summary in summaries:
        del summary["provenance"]["command"]
    assert summaries[0] == summaries[1]
    assert run(command, "merge", "cut") == shown.partition("\n")[2]  # a second time it changes nothing
    shards = [summary_of(cut / "shards" / number)["episodes"] for number in "123"]
    assert shards == [14, 14, 12]  # two in each of 20 mazes
    assert run(command, "report", "cut", "--out", "report").startswith("1 result of planner")


def test_a_suite_has_the_same_bytes(command, tmp_path):
    words = ("eval", "--suite", "few", "--agent", "planner", "--agent", "random")
    run(command, *words, "--out", "whole")
    assert without_shards(merged(command, *words)) == results_of(tmp_path / "whole")


def test_one_maze_is_one_share_and_others_have_none(command, tmp_path):
    maze = generate("dfs", 9, np.random.default_rng(0))
    pathlib.Path("maze.txt").write_text(
        "\n".join("".join(" #"[wall] for wall in row) for row in maze.walls.astype(int))
    )
    words = ("eval", "--agent", "planner", "--mazes", "maze.txt", "--distances", "1,2")
    run(command, *words, "--out", "whole")
    assert without_shards(merged(command, *words)) == results_of(tmp_path / "whole")
    assert sorted(path.name for path in pathlib.Path("cut/shards").iterdir()) == [
        "1",
        "1.json",
        "2",
        "2.json",
        "3",
        "3.json",
    ]
    assert not any(pathlib.Path("cut/shards/2").iterdir())


def test_a_shard_is_resumed_and_refused_without_that(command, cut):
    shard = (*EVAL, "--record", "--out", "cut", "--shard", "2/3")
    assert "holds a run already; go on with --resume" in command(*shard)[2]
    pathlib.Path("cut/shards/2/summary.json").unlink()
    run(command, *shard, "--resume")
    assert summary_of(cut / "shards" / "2")["episodes"] == 14


def test_slurm_numbers_the_shards(command, monkeypatch):
    monkeypatch.setenv("SLURM_ARRAY_TASK_ID", "2")
    monkeypatch.setenv("SLURM_ARRAY_TASK_COUNT", "20")
    assert "results in cut/shards/2" in run(command, *EVAL, "--out", "cut", "--shard", "slurm")
    monkeypatch.setenv("SLURM_ARRAY_TASK_ID", "0")
    for text, said in (
        ("slurm", "expected SLURM_ARRAY_TASK_ID / SLURM_ARRAY_TASK_COUNT from 1/N to N/N, found '0/20'"),
        ("4/3", "expected --shard from 1/N to N/N, found '4/3'"),
        ("2/9", "cut/shards/2: holds shard 2/20, this one is 2/9"),
    ):
        assert command(*EVAL, "--out", "cut", "--shard", text)[::2] == (2, f"mazebench: {said}\n")
    assert "mazebench: --shard needs --out" in command(*EVAL, "--shard", "1/2")[2]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda shards: shutil.rmtree(shards), "cut: expected shards that have ended, found none"),
        (lambda shards: (shards / "2.json").unlink(), "cut: expected 3 shards that have ended, found 2; missing: 2"),
        (lambda shards: edit(shards / "2.json", of=4), "cut: expected 4 shards, found shard 1/3 of another run"),
        (
            lambda shards: edit(shards / "2/config.json", seed=5),
            "cut/shards/2: holds another run: its seed is 5, this o",
        ),
        (lambda shards: other_numpy(shards / "3/summary.json"), "cut/shards/3: expected numpy "),
        (
            lambda shards: copy(shards / "1", shards / "2"),
            "cut: expected each episode in one of its shards, found some",
        ),
        (
            lambda shards: (shards / "2/summary.json").unlink(),
            "cut/shards/2: expected a finished evaluation, found one",
        ),
        (
            lambda shards: copy(shards / "1/trajectories.npz", shards / "3/trajectories.npz"),
            "cut: expected 40 trajecto",
        ),
    ],
)
def test_what_is_missing_or_of_another_run_is_named(command, cut, change, said):
    (cut / "summary.json").unlink()
    change(cut / "shards")
    status, _, errors = command("merge", "cut")
    assert (status, errors.count("\n")) == (2, 1)
    assert errors.startswith(f"mazebench: {said}")
    assert not (cut / "summary.json").exists()


def edit(path: pathlib.Path, **values) -> None:
    path.write_text(json.dumps(json.loads(path.read_text()) | values))


def other_numpy(path: pathlib.Path) -> None:
    origin = json.loads(path.read_text())["provenance"]
    edit(path, provenance=origin | {"packages": origin["packages"] | {"numpy": "0.1"}})


def copy(source: pathlib.Path, target: pathlib.Path) -> None:
    if source.is_dir():
        shutil.copytree(source, target, dirs_exist_ok=True)
    else:
        shutil.copyfile(source, target)
