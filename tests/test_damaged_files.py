"""Damaged files: each is named in one line with exit status 2, and nothing in them is unpickled or imported."""

from __future__ import annotations

import contextlib
import io
import os
import pathlib
import pickle
import shutil
import sys

import pytest
from faults import TRAIN, said
from run_folders import RECORDED

from mazebench import cli

EVAL = ["eval", "--agent", "random", "--distances", "1", "--episodes-per-distance", "1"]
LEARN = [*TRAIN, "--env-steps", "800"]
PLAN = b"#####\n#...#\n#.#.#\n#...#\n#####\n"
MARK = "code_has_run"  # a folder that code in a file would make in the working directory


class MakesFolder:
    """Unpickling it makes a folder."""

    def __reduce__(self):
        return os.mkdir, (MARK,)


DAMAGE = {
    "empty": lambda content: b"",
    "cut short": lambda content: content[: len(content) // 2],
    "a pickle": lambda content: pickle.dumps(MakesFolder()),
}
damaged = pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)


def run(*words: str | pathlib.Path) -> tuple[int, list[str]]:
    """Runs a command in this process; returns its exit status and its errors, without lines of progress."""
    errors = io.StringIO()
    with (
        pytest.MonkeyPatch.context() as patch,
        contextlib.redirect_stdout(io.StringIO()),
        contextlib.redirect_stderr(errors),
    ):
        patch.setattr(sys, "argv", ["mazebench", *map(str, words)])
        with pytest.raises(SystemExit) as caught:
            cli.main()
    return caught.value.code, said(errors.getvalue())


def refusal(*words: str | pathlib.Path) -> str:
    """The line with which a command refuses bad input."""
    status, lines = run(*words)
    assert (status, len(lines)) == (2, 1), lines
    assert lines[0].startswith("mazebench: ")
    assert not pathlib.Path(MARK).exists()
    return lines[0]


def copied(folder: pathlib.Path, to: pathlib.Path) -> pathlib.Path:
    shutil.copytree(folder, to)
    return to


@pytest.fixture(autouse=True)
def empty_working_directory(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module")
def result(tmp_path_factory) -> pathlib.Path:
    """An evaluation of 20 episodes."""
    folder = tmp_path_factory.mktemp("results") / "run"
    assert run(*EVAL, "--record", "--out", folder)[0] == 0
    return folder


@pytest.fixture(scope="module")
def training(tmp_path_factory) -> pathlib.Path:
    """A training run of 800 steps."""
    folder = tmp_path_factory.mktemp("training") / "run"
    assert run(*LEARN, "--out", folder) == (0, [])
    return folder


def last_checkpoint(run: pathlib.Path) -> pathlib.Path:
    return max((run / "checkpoints").iterdir())


@damaged
def test_a_damaged_map_is_named_in_one_line(damage):
    path = pathlib.Path("plan.txt")
    path.write_bytes(damage(PLAN))
    assert "plan" in refusal(*EVAL, "--maps", path)


@damaged
def test_a_damaged_checkpoint_is_named_in_one_line(training, damage):
    path = pathlib.Path("agent.safetensors")
    path.write_bytes(damage((last_checkpoint(training) / path).read_bytes()))
    assert f"{path}: expected a checkpoint" in refusal("eval", "--agent", "mah", "--checkpoint", path)


@damaged
@pytest.mark.parametrize("name", ["summary.json", "episodes.jsonl"])
def test_a_damaged_result_is_named_in_one_line(result, tmp_path, name, damage):
    folder = copied(result, tmp_path / "run")
    (folder / name).write_bytes(damage((result / name).read_bytes()))
    line = refusal("compare", folder, folder)
    assert str(folder) in line
    assert name in line
    assert "expected" in line


@damaged
def test_a_damaged_suite_is_named_in_one_line(tmp_path, damage):
    path = tmp_path / "suite.json"
    path.write_bytes(damage(b'{"parts":["near"],"folders":{"random":"random"}}'))
    assert f"{path}: expected" in refusal("compare", tmp_path, tmp_path)


@damaged
def test_resuming_a_run_with_a_damaged_config_is_refused(result, tmp_path, damage):
    folder = copied(result, tmp_path / "run")
    (folder / "summary.json").unlink()
    (folder / "config.json").write_bytes(damage((result / "config.json").read_bytes()))
    assert f"{folder / 'config.json'}: " in refusal(*EVAL, "--out", folder, "--resume")


@damaged
@pytest.mark.parametrize("name", ["summary.json", "episodes.jsonl", "trajectories.npz"])
def test_a_finished_run_with_a_damaged_file_is_mended_by_deleting_that(result, tmp_path, name, damage):
    folder = copied(result, tmp_path / "run")
    path = folder / name
    path.write_bytes(damage(path.read_bytes()))
    for record in ([], ["--record"]):
        line = refusal(*EVAL, *record, "--out", folder, "--resume")
        assert name in line
        assert "delete the damaged file, and --resume runs the episodes again" in line
    path.unlink()
    assert run(*EVAL, "--record", "--out", folder, "--resume") == (0, [])
    assert {file.name for file in folder.iterdir()} == RECORDED
    assert (folder / "trajectories.npz").read_bytes() == (result / "trajectories.npz").read_bytes()
    assert (folder / "episodes.jsonl").read_bytes() == (result / "episodes.jsonl").read_bytes()


@damaged
@pytest.mark.parametrize(
    "name",
    ["config.json", "agent.safetensors", "training.safetensors", "replay.npz", "random.json", "counters.json"],
)
def test_resuming_a_training_with_a_damaged_file_is_refused(training, tmp_path, name, damage):
    folder = copied(training, tmp_path / "run")
    path = (folder if name == "config.json" else last_checkpoint(folder)) / name
    path.write_bytes(damage(path.read_bytes()))
    assert f"{path}: " in refusal(*LEARN, "--out", folder, "--resume")
