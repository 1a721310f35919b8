"""Damaged files: each is named in one line with exit status 2, and nothing in them is unpickled or imported."""

from __future__ import annotations

import contextlib
import io
import json
import os
import pathlib
import pickle
import shutil
import sys
import tempfile
import warnings

import numpy as np
import PIL.Image
import pytest
from faults import TRAIN, said
from hypothesis import given, settings
from hypothesis import strategies as st

from mazebench import cli
from mazebench.errors import InputError, Remark
from mazebench.maps.kinds import generate
from mazebench.maps.maze_files import read_maze
from mazebench.maps.pictures import draw_maze
from mazebench.maps.readers.ros import write_ros_map

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


@pytest.fixture(scope="module")
def maps(tmp_path_factory) -> pathlib.Path:
    """A folder with one maze as a file of each kind that is read as a map."""
    folder = tmp_path_factory.mktemp("maps")
    maze = generate("dfs", 13, np.random.default_rng(0))
    for suffix in ("png", "jpg", "webp", "gif", "ppm", "bmp", "noname"):
        PIL.Image.fromarray(draw_maze(maze, 4)).save(folder / f"plan.{suffix}", "PNG" if suffix == "noname" else None)
    np.save(folder / "walls.npy", maze.walls)
    np.save(folder / "letters.npy", np.where(maze.walls, "#", "."))
    np.savez(folder / "stored.npz", maze.walls)
    np.savez_compressed(folder / "packed.npz", maze.walls)
    (folder / "rows.json").write_text(json.dumps(maze.walls.tolist()))
    (folder / "grid.json").write_text(json.dumps({"grid": maze.walls.astype(int).tolist()}))
    write_ros_map(maze, folder / "map.yaml")
    return folder


@given(st.data())
@settings(max_examples=200, deadline=None)
def test_a_map_cut_or_changed_anywhere_is_read_or_refused_in_one_line(maps, data):
    with tempfile.TemporaryDirectory() as name:
        folder, original = pathlib.Path(name), data.draw(st.sampled_from(sorted(maps.iterdir())))
        path, content = folder / original.name, bytearray(original.read_bytes())
        if path.suffix == ".pgm":
            shutil.copy(maps / "map.yaml", folder)
        for position in data.draw(st.lists(st.integers(0, len(content) - 1) | st.integers(0, 99), max_size=3)):
            content[position] = data.draw(st.integers(0, 255))
        path.write_bytes(content[: data.draw(st.integers(0, len(content)) | st.just(len(content)))])
        with warnings.catch_warnings(action="error"), np.errstate(all="raise"):
            warnings.simplefilter("ignore", Remark)
            try:
                said = read_maze(path if path.suffix != ".pgm" else folder / "map.yaml").name
            except InputError as error:
                said = str(error)
        assert said.isprintable()


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
