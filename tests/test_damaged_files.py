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

from mazebench import cli

EVAL = ["eval", "--agent", "random", "--distances", "1", "--episodes-per-distance", "1"]
LEARN = [*TRAIN, "--env-steps", "800"]
SUITE = b'{"parts":["near"],"folders":{"random":"random"}}'
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


@pytest.fixture(autouse=True)
def empty_working_directory(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture(scope="module")
def folders(tmp_path_factory) -> dict[str, pathlib.Path]:
    """A folder with each kind of file."""
    top = tmp_path_factory.mktemp("whole")
    assert run(*EVAL, "--record", "--out", top / "result")[0] == 0
    shutil.copytree(top / "result", top / "unfinished")
    (top / "unfinished" / "summary.json").unlink()
    assert run(*LEARN, "--out", top / "training") == (0, [])
    for name, file, content in (("map", "plan.txt", PLAN), ("suite", "suite.json", SUITE)):
        (top / name).mkdir()
        (top / name / file).write_bytes(content)
    return {folder.name: folder for folder in top.iterdir()}


CHECKPOINT = "checkpoints/000000000800"
IN_CHECKPOINT = ("agent.safetensors", "training.safetensors", "replay.npz", "random.json", "counters.json")
RESUME = ["--out", "run", "--resume"]


@damaged
@pytest.mark.parametrize(
    ("kind", "file", "words"),
    [
        ("map", "plan.txt", [*EVAL, "--mazes", "run/plan.txt"]),
        ("result", "summary.json", ["compare", "run", "run"]),
        ("result", "episodes.jsonl", ["compare", "run", "run"]),
        ("suite", "suite.json", ["compare", "run", "run"]),
        ("unfinished", "config.json", [*EVAL, *RESUME]),
        ("training", f"{CHECKPOINT}/agent.safetensors", ["eval", "--agent", "mah", "--checkpoint", "run"]),
        ("training", "config.json", [*LEARN, *RESUME]),
        *(("training", f"{CHECKPOINT}/{name}", [*LEARN, *RESUME]) for name in IN_CHECKPOINT),
    ],
)
def test_a_damaged_file_is_named_in_one_line(folders, kind, file, words, damage):
    path = shutil.copytree(folders[kind], "run") / pathlib.Path(file)
    path.write_bytes(damage(path.read_bytes()))
    if kind == "map" and damage is DAMAGE["cut short"]:  # the last row is then a short one, as some levels have them
        status, lines = run(*words)  # of which another may say that kernels are compiled
        assert status == 0
        assert any("plan: short rows filled with wall" in line for line in lines)
        return
    assert (path.stem if kind == "map" else path.name) in refusal(*words)
