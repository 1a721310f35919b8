"""The command line: what it writes, and one line with exit status 2 for whatever bad input."""

from __future__ import annotations

import json
import os
import pathlib
import shutil
import subprocess
import sys

import cv2
import mujoco
import numpy as np
import pytest
import trimesh
import typer

from mazebench import __version__, cli
from mazebench.agent import agent_names
from mazebench.errors import InputError
from mazebench.maps.files import read_maze
from mazebench.maps.generators import generate
from mazebench.maps.maze import point_to_cell
from mazebench.maps.text import format_maze, write_text_maze

TINY = ("eval", "--agent", "random", "--distances", "1,2", "--episodes-per-distance", "1")
QUICK = ("eval", "--suite", "quick", "--agent", "random")
PLAN = "#####\n#...#\n#.#.#\n#...#\n#####\n"


@pytest.fixture
def command(tmp_path, monkeypatch, capsys):
    """Runs a command in this process, in an empty working directory; gives exit status, output and errors."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str | pathlib.Path) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["mazebench", *map(str, arguments)])
        capsys.readouterr()
        with pytest.raises(SystemExit) as caught:
            cli.main()
        return caught.value.code, *capsys.readouterr()

    return run


@pytest.fixture(scope="module")
def bad(tmp_path_factory) -> pathlib.Path:
    """A folder of things that can't be used."""
    folder = tmp_path_factory.mktemp("bad")
    (folder / "file").touch()
    (folder / "binary.txt").write_bytes(np.random.default_rng(0).bytes(3000))
    (folder / "binary.png").write_bytes(np.random.default_rng(1).bytes(3000))
    (folder / "ragged.txt").write_text(PLAN.replace("#.#.#", "#.#.##"))
    (folder / "open.txt").write_text(PLAN.replace("#.#.#", "#.#.."))
    (folder / "disconnected.txt").write_text(PLAN.replace("#...#", "#.#.#"))
    (folder / "4x4.txt").write_text("####\n#..#\n#..#\n####\n")
    (folder / "cell.txt").write_text("#####\n#####\n##.##\n#####\n#####\n")
    (folder / "unknown.txt").write_text(PLAN.replace("#.#.#", "#.@.#"))
    (folder / "gray.png").write_bytes(cv2.imencode(".png", np.full((50, 50), 128, np.uint8))[1].tobytes())
    for name in ("sparse.txt", "sparse.png", "checkpoint"):
        (folder / name).touch()
        os.truncate(folder / name, 100 * 2**20)
    (folder / "empty").mkdir()
    (folder / "mixed").mkdir()
    (folder / "good.txt").write_text(PLAN)
    shutil.copy(folder / "good.txt", folder / "mixed" / "a.txt")
    write_text_maze(generate("dfs", 7, np.random.default_rng(0)), folder / "mixed" / "b.txt")
    (folder / "used").mkdir()
    (folder / "used" / "thesis.tex").touch()
    return folder


BAD_INPUT = [
    (("frobnicate",), "No such command 'frobnicate'"),
    (("--frobnicate",), "No such option"),
    # generate
    (("generate", "--style", "spiral"), "unknown style 'spiral'; available: dfs, obstacles, rooms"),
    (("generate", "--size", "14"), "style 'dfs' makes mazes of odd sizes only, found size 14"),
    (("generate", "--size", "14", "--style", "rooms"), "style 'rooms' makes mazes of odd sizes only, found size 14"),
    (("generate", "--size", "3"), "expected a size of 5 to 255 cells, found 3"),
    (("generate", "--size", "300"), "expected a size of 5 to 255 cells, found 300"),
    (("generate", "--size", "-13"), "expected a size of 5 to 255 cells, found -13"),
    (("generate", "--size", "thirteen"), "Invalid value for '--size'"),
    (("generate", "--count", "0"), "Invalid value for '--count'"),
    (("generate", "--seed", "-1"), "Invalid value for '--seed'"),
    (("generate", "--format", "txt,gif"), "unknown format 'gif'; available: glb, mjcf, obj, png, stl, txt"),
    (("generate", "--format", ""), "unknown format ''"),
    (("generate", "--out", "{bad}/file/mazes"), "file/mazes: can't write there: Not a directory"),
    (("generate", "--out", "{bad}/file"), "file: can't write there: File exists"),
    (("generate", "--from-image", "x.png", "--seed", "1"), "the picture shows one maze; found --seed, which would"),
    (("generate", "--from-image", "none.png"), "none.png: can't read the picture: No such file or directory"),
    (("generate", "--from-image", "{bad}/binary.png"), "expected a PNG, JPEG or BMP picture, found 3000 bytes"),
    (("generate", "--from-image", "{bad}/gray.png"), "gray: expected "),
    (("generate", "--from-image", "{bad}/sparse.png"), "expected a picture of at most 32 MiB, found more"),
    (("generate", "--from-image", "{bad}/empty"), "empty: can't read the map: Is a directory"),
    # eval: names
    (("eval",), "Missing option '--agent'"),
    (("eval", "--agent", "nobody"), "unknown agent 'nobody'; available: "),
    (("eval", "--agent", "no_such_module:Agent"), "found: No module named 'no_such_module'"),
    (("eval", "--agent", "json:Agent"), "found: module 'json' has no attribute 'Agent'"),
    (("eval", "--agent", "json:loads"), "expected a class with build, initial_state and act, found no build"),
    (("eval", "--agent", ":"), "expected module:Class that can be imported"),
    (("eval", "--agent", "..json:loads"), "expected module:Class that can be imported"),
    ((*TINY, "--task", "locl"), "'locl' is not one of 'local', 'hierarchical'"),
    ((*TINY, "--split", "test"), "'test' is not one of 'train', 'eval'"),
    ((*TINY, "--size", "14"), "unknown size '14'; available: 13, 15, 17, 19, 21"),
    ((*TINY, "--speed", "9"), "No such option: --speed"),
    ((*TINY, "--checkpoint", "none"), "agent 'random' reads no checkpoint; found --checkpoint none"),
    # eval: numbers
    ((*TINY, "--num-envs", "0"), "Invalid value for '--num-envs'"),
    ((*TINY, "--workers", "-1"), "Invalid value for '--workers'"),
    ((*TINY, "--episodes-per-distance", "0"), "Invalid value for '--episodes-per-distance'"),
    ((*TINY, "--landmark-distance", "0"), "Invalid value for '--landmark-distance'"),
    # eval: options that another one leaves without effect
    ((*TINY, "--task", "hierarchical"), "leads from corner to corner; found --distances, which would be ignored"),
    (("eval", "--agent", "random", "--task", "hierarchical", "--episodes-per-distance", "5"), "found --episodes-per"),
    ((*TINY, "--landmark-distance", "5"), "the local task has no landmarks; found --landmark-distance, which would"),
    (
        (*TINY, "--maps", "{bad}/good.txt", "--split", "eval"),
        "with --maps the mazes are your own; found --split, which",
    ),
    ((*TINY, "--agent", "planner"), "expected one --agent without --suite, found 2"),
    # eval: suites
    ((*QUICK, "--suite", "papr"), "unknown suite 'papr'; available: paper, quick"),
    ((*QUICK, "--task", "local"), "the suite 'quick' has evaluations of its own; found --task, which would be ignored"),
    ((*QUICK, "--size", "13"), "found --size, which would be ignored"),
    ((*QUICK, "--maps", "{bad}/good.txt"), "found --maps, which would be ignored"),
    ((*QUICK, "--distances", "2"), "found --distances, which would be ignored"),
    ((*QUICK, "--position-noise", "0"), "found --position-noise, which would be ignored"),
    ((*QUICK, "--agent", "random"), "expected agents with folders of their own, found two for 'random'"),
    ((*QUICK, "--agent", "planner", "--checkpoint", "x"), "expected one agent with --checkpoint, found 2"),
    ((*QUICK, "--agent", "nobody"), "unknown agent 'nobody'; available: "),
    ((*QUICK, "--out", "{bad}/used"), "expected an empty folder or a suite's, found 'thesis.tex' in it"),
    ((*QUICK, "--out", "{bad}/file/out"), "file/out: can't write there: Not a directory"),
    ((*QUICK, "--resume"), "--resume needs --out"),
    # compare
    (("compare", "{bad}/empty"), "Missing argument 'B'"),
    (("compare", "none", "{bad}/used"), "none: expected a finished evaluation, found nothing there"),
    (("compare", "{bad}/empty", "{bad}/used"), "empty: expected a finished evaluation, found an empty folder"),
    (("compare", "{bad}/used", "{bad}/empty"), "used: expected a finished evaluation, found 'thesis.tex' in it"),
    (("compare", "{bad}/file", "{bad}/used"), "file: expected a finished evaluation, found a file"),
    # train
    (("train", "--agent", "mah", "--ray", "auto"), "without --workers this process collects by itself; found --ray"),
    ((*TINY, "--seed", "-1"), "Invalid value for '--seed'"),
    ((*TINY, "--map-flip", "1.5"), "expected map_flip from 0 to 1.0, found 1.5"),
    ((*TINY, "--map-flip", "nan"), "expected map_flip from 0 to 1.0, found nan"),
    ((*TINY, "--map-warp", "0.3"), "expected map_warp from 0 to 0.25, found 0.3"),
    ((*TINY, "--map-warp", "-0.1"), "expected map_warp from 0 to 0.25, found -0.1"),
    ((*TINY, "--position-noise", "nan"), "expected position_noise from 0 to 1000.0, found nan"),
    ((*TINY, "--position-noise", "inf"), "expected position_noise from 0 to 1000.0, found inf"),
    ((*TINY, "--position-noise", "-1"), "expected position_noise from 0 to 1000.0, found -1"),
    ((*TINY, "--distances", "one"), "expected distances like 1-5,8,10, found 'one'"),
    ((*TINY, "--distances", "500"), "13-eval-00: no two cells are 500 cells apart; the farthest are 50"),
    ((*TINY, "--distances", "1-99999"), "no two cells are 99999 cells apart"),
    # eval: files
    ((*TINY, "--out", "{bad}/file"), "file: can't write there: File exists"),
    ((*TINY, "--out", "{bad}/file/out"), "file/out: can't write there: Not a directory"),
    ((*TINY, "--out", "a" * 300), "can't write there: File name too long"),
    ((*TINY, "--out", "{bad}/used"), "expected an empty folder or an evaluation's, found 'thesis.tex' in it"),
    ((*TINY, "--out", "{bad}/used", "--resume"), "expected an empty folder or an evaluation's, found 'thesis.tex'"),
    ((*TINY, "--out", "{bad}/file", "--resume"), "file: can't write there: File exists"),
    ((*TINY, "--resume"), "--resume needs --out"),
    ((*TINY, "--maps", "none.txt"), "none.txt: can't read the map: No such file or directory"),
    ((*TINY, "--maps", "{bad}/binary.txt"), "binary.txt: expected a text map, found byte 0x"),
    ((*TINY, "--maps", "{bad}/binary.png"), "binary.png: expected a PNG, JPEG or BMP picture"),
    ((*TINY, "--maps", "{bad}/ragged.txt"), "ragged: expected rows of 5 cells like the first, found 6 in row 2"),
    ((*TINY, "--maps", "{bad}/open.txt"), "open: expected a closed border, found cell (2, 4) free"),
    ((*TINY, "--maps", "{bad}/disconnected.txt"), "cell (1, 3) cannot be reached from (1, 1)"),
    ((*TINY, "--maps", "{bad}/4x4.txt"), "4x4: expected 5 to 255 cells a side, found 4"),
    ((*TINY, "--maps", "{bad}/unknown.txt"), "found '@' at (2, 2)"),
    ((*TINY, "--maps", "{bad}/sparse.txt"), "sparse.txt: expected a map of at most 65535 bytes"),
    ((*TINY, "--maps", "{bad}/empty"), "empty: expected 1 to 10000 maps"),
    ((*TINY, "--maps", "{bad}/mixed"), "expected mazes of one size, found sizes [5, 7]"),
    ((*TINY, "--maps", "{bad}/good.txt", "--size", "7"), "expected mazes of size 7, found size 5"),
    ((*TINY, "--maps", "{bad}/cell.txt"), "cell: no two cells are 2 cells apart; the farthest are 0"),
    (("eval", "--agent", "random", "--maps", "{bad}/cell.txt", "--task", "hierarchical"), "cell: "),
    ((*TINY, "--maps", "{bad}/good.txt", "--distances", "1-5"), "good: no two cells are 5 cells apart; the farthest"),
    # render
    (("render",), "Missing option '--out'"),
    (("render", "--out", "film.avi"), "unknown suffix '.avi'; available: .gif, .mp4, .png"),
    (("render", "--out", "x.png", "--task", "hierarchical", "--distances", "9"), "found --distances, which would be"),
    (("render", "--out", "x.png", "--maps", "{bad}/good.txt", "--split", "train"), "found --split, which would be ign"),
    (("render", "--out", "x.png", "--landmark-distance", "3"), "found --landmark-distance, which would be ignored"),
    (("render", "--out", "x.png", "--map-warp", "0.5"), "expected map_warp from 0 to 0.25, found 0.5"),
    (("play", "--task", "hierarchical", "--distances", "9"), "found --distances, which would be ignored"),
    (("play", "--landmark-distance", "3"), "found --landmark-distance, which would be ignored"),
    (("play", "--maps", "{bad}/good.txt", "--split", "train"), "found --split, which would be ignored"),
    (("play", "--maps", "{bad}/open.txt"), "expected a closed border"),
    (("play", "--maps", "{bad}/good.txt", "--distances", "9"), "no two cells are 9 cells apart"),
    (("play", "--size", "14"), "unknown size '14'"),
    (("play", "--terminal"), "expected a terminal to play on, found a file or a pipe"),
    (("render", "--out", "x.png", "--view", "side"), "unknown view 'side'; available: all, chase, egocentric, map"),
    (("render", "--out", "x.png", "--pixels", "10"), "Invalid value for '--pixels'"),
    (("render", "--out", "x.png", "--agent", "nobody"), "unknown agent 'nobody'"),
    (("render", "--out", "{bad}/file/x.png", "--view", "map"), "file/x.png: can't write"),
    (("bench", "--fast"), "No such option: --fast"),
    (("list", "all"), "unexpected extra argument"),
]


class TestBadInput:
    @pytest.mark.parametrize(
        ("arguments", "said"), BAD_INPUT, ids=[" ".join(arguments)[-60:] for arguments, _ in BAD_INPUT]
    )
    def test_command_when_input_is_bad(self, command, bad, tmp_path, arguments, said):
        before = sorted(bad.rglob("*"))
        status, _, errors = command(*(argument.replace("{bad}", str(bad)) for argument in arguments))
        assert status == 2
        assert errors.startswith("mazebench: ")
        assert errors.count("\n") == 1
        assert errors.endswith("\n")
        assert said in errors
        assert "Traceback" not in errors
        assert list(tmp_path.iterdir()) == []
        assert sorted(bad.rglob("*")) == before

    def test_eval_when_out_holds_another_run(self, command, tmp_path):
        assert command(*TINY, "--out", "run")[0] == 0
        before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
        for arguments, said in [
            (TINY, "run: holds a run already; go on with --resume or name another folder"),
            ((*TINY, "--resume", "--seed", "1"), "run: holds another run: its seed is 0, this one's 1"),
            ((*TINY, "--resume", "--size", "15"), "run: holds another run: its record is "),
        ]:
            status, _, errors = command(*arguments, "--out", "run")
            assert (status, errors.count("\n")) == (2, 1)
            assert said in errors
        assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before

    def test_eval_when_records_are_corrupted(self, command, tmp_path):
        command(*TINY, "--out", "run")
        (tmp_path / "run" / "summary.json").unlink()
        (tmp_path / "run" / "episodes.jsonl").write_text("rubbish\n")
        status, _, errors = command(*TINY, "--out", "run", "--resume")
        assert (status, errors.count("\n")) == (2, 1)
        assert "episodes.jsonl: expected a record in line 1, found b'rubbish'" in errors

    def test_module_when_run_as_process(self):
        run = subprocess.run(
            [sys.executable, "-m", "mazebench", "eval", "--agent", "nobody"], capture_output=True, text=True
        )
        assert (run.returncode, run.stdout, run.stderr.count("\n")) == (2, "", 1)
        assert run.stderr.startswith("mazebench: unknown agent 'nobody'")


class TestParseDistances:
    @pytest.mark.parametrize(
        ("text", "distances"),
        [
            ("7", (7,)),
            ("1-5", (1, 2, 3, 4, 5)),
            ("1-5,8,10", (1, 2, 3, 4, 5, 8, 10)),
            ("10,8,1-3,2-4", (1, 2, 3, 4, 8, 10)),
            (" 3 , 1-2 ", (1, 2, 3)),
            ("4-4", (4,)),
            ("007", (7,)),
        ],
    )
    def test_distances_when_worked_by_hand(self, text, distances):
        assert cli.parse_distances(text) == distances

    @pytest.mark.parametrize(
        "text",
        [
            *(
                "",
                ",",
                "1,",
                ",1",
                "1,,2",
                "a",
                "1-",
                "-1",
                "-",
                "1-2-3",
                "1--2",
                "1.5",
                "1e2",
                "+1",
                "²",
                "0x1",
                "1 2",
            ),
            *("0", "0-3", "5-1", "1-3,9-5", "123456", "1-123456", "nan", "1-5;8", "1:5"),
        ],
    )
    def test_distances_when_text_is_bad(self, text):
        with pytest.raises(InputError, match=r"^expected distances "):
            cli.parse_distances(text)


class TestHelp:
    def test_help_when_no_command_is_given(self, command):
        status, output, errors = command()
        assert (status, errors) == (0, "")
        for name in typer.main.get_command(cli.app).commands:
            assert f"\n  {name} " in output

    @pytest.mark.parametrize("name", sorted(typer.main.get_command(cli.app).commands))
    def test_help_when_asked_of_a_command(self, command, name):
        status, output, errors = command(name, "--help")
        assert (status, errors) == (0, "")
        assert f" {name} [OPTIONS]" in output.splitlines()[0]

    def test_version_when_asked(self, command):
        assert command("--version") == (0, f"{__version__}\n", "")

    def test_list_when_called(self, command):
        status, output, errors = command("list")
        assert (status, errors) == (0, "")
        for word in (*agent_names(), "local", "hierarchical", "dfs", "rooms", "obstacles", "13, 15, 17, 19, 21", "v1"):
            assert word in output


class TestGenerate:
    def test_files_when_read_again(self, command, tmp_path):
        status, output, errors = command(
            *("generate", "--size", "9", "--count", "2", "--seed", "3"),
            *("--out", "mine", "--format", "txt,mjcf,png,glb,obj,stl"),
        )
        assert (status, errors) == (0, "")
        names = {f"dfs-9-3-{i:03d}.{suffix}" for i in range(2) for suffix in ("txt", "xml", "png", "glb", "obj", "stl")}
        assert {path.name for path in (tmp_path / "mine").iterdir()} == names
        assert all(f"mine/{name}\n" in output for name in names)
        mazes = [read_maze(tmp_path / "mine" / f"dfs-9-3-{i:03d}.txt") for i in range(2)]
        assert mazes[0] != mazes[1]
        assert format_maze(mazes[0]) in output  # the first is shown
        for i, maze in enumerate(mazes):
            stem = str(tmp_path / "mine" / f"dfs-9-3-{i:03d}")
            assert read_maze(stem + ".png") == maze
            assert mjcf_walls(stem + ".xml", 9) == {tuple(cell) for cell in np.argwhere(maze.walls)}
            for suffix in ("glb", "obj", "stl"):
                mesh = trimesh.load(f"{stem}.{suffix}", force="mesh")
                assert mesh.is_watertight
                assert mesh.volume == pytest.approx(maze.walls.sum(), rel=0.01)

    def test_mazes_when_seed_style_and_count_differ(self, command, tmp_path):
        for out, *arguments in [
            ("first",),
            ("again", "--count", "3"),
            ("seed", "--seed", "1"),
            ("style", "--style", "rooms"),
        ]:
            assert command("generate", "--size", "11", "--format", "txt", "--out", out, *arguments)[0] == 0
        texts = {path.parent.name + path.name: path.read_text() for path in tmp_path.rglob("*.txt")}
        assert texts["firstdfs-11-0-000.txt"] == texts["againdfs-11-0-000.txt"]
        assert len(texts) == 6
        assert len(set(texts.values())) == 5

    @pytest.mark.parametrize("style", ["dfs", "rooms", "obstacles"])
    def test_maze_when_read_off_its_picture(self, command, tmp_path, style):
        command("generate", "--size", "13", "--style", style, "--format", "txt,png", "--out", "drawn")
        picture = f"drawn/{style}-13-0-000.png"
        status, _, errors = command("generate", "--from-image", picture, "--format", "txt", "--out", "read")
        assert (status, errors) == (0, "")
        name = f"{style}-13-0-000.txt"
        assert (tmp_path / "read" / name).read_text() == (tmp_path / "drawn" / name).read_text()

    def test_files_when_nothing_is_asked_for(self, command, tmp_path):
        assert command("generate")[0] == 0
        expected = {f"dfs-13-0-000.{suffix}" for suffix in ("txt", "xml", "png", "glb")}
        assert {path.name for path in (tmp_path / "mazes").iterdir()} == expected


class TestEval:
    def test_results_when_out_is_given(self, command, tmp_path):
        status, output, errors = command(*TINY, "--out", "run")
        assert status == 0
        assert "random, local: 40 of 40 episodes\n" in errors  # plain lines where there is no terminal
        assert "resuming" not in output
        assert "results in run\n" in output
        assert {path.name for path in (tmp_path / "run").iterdir()} == {"config.json", "episodes.jsonl", "summary.json"}

    def test_results_when_out_is_not_given(self, command, tmp_path):
        assert command(*TINY)[0] == 0
        assert command(*TINY)[0] == 0
        folders = list((tmp_path / "results").iterdir())
        assert len(folders) == 2
        assert all(folder.name.startswith("random-local-") for folder in folders)

    def test_table_when_terminal_has_80_columns(self, command, monkeypatch):
        monkeypatch.setenv("COLUMNS", "80")
        _, output, _ = command(*TINY, "--out", "run")
        assert "…" not in output
        assert max(len(line) for line in output.splitlines()) <= 80
        for word in ("distance", "success rate", "paper", "SPL", "SPL by grid", "all"):
            assert word in output

    @pytest.mark.parametrize("there", [False, True])
    def test_resume_when_folder_is_missing_or_empty(self, command, tmp_path, there):
        if there:
            (tmp_path / "run").mkdir()
        status, output, _ = command(*TINY, "--out", "run", "--resume")
        assert status == 0
        assert "resuming" not in output
        assert (tmp_path / "run" / "summary.json").exists()

    def test_resume_when_run_is_finished(self, command, tmp_path):
        command(*TINY, "--out", "run")
        before = {path.name: path.read_bytes() for path in (tmp_path / "run").iterdir()}
        status, output, errors = command(*TINY, "--out", "run", "--resume")
        assert (status, errors) == (0, "")
        assert "run: the run is finished\n" in output
        assert {path.name: path.read_bytes() for path in (tmp_path / "run").iterdir()} == before

    def test_resume_when_run_is_partial(self, command, tmp_path):
        command(*TINY, "--out", "run")
        (tmp_path / "run" / "summary.json").unlink()
        episodes = tmp_path / "run" / "episodes.jsonl"
        whole = episodes.read_bytes()
        episodes.write_bytes(whole[: len(whole) // 2])
        status, output, _ = command(*TINY, "--out", "run", "--resume")
        assert status == 0
        assert "resuming run\n" in output
        assert episodes.read_bytes() == whole

    def test_eval_when_maps_are_ones_own(self, command, tmp_path):
        (tmp_path / "plan.txt").write_text(PLAN)
        status, output, _ = command(*TINY, "--maps", "plan.txt", "--out", "run")
        assert status == 0
        assert "random: local, custom mazes 5 x 5" in output

    def test_trajectories_when_asked_for(self, command, tmp_path):
        assert command(*TINY, "--out", "run", "--record")[0] == 0
        assert (tmp_path / "run" / "trajectories.npz").exists()

    def test_eval_when_an_agent_breaks_its_contract(self, command, tmp_path):
        (tmp_path / "wrong_at_hand.py").write_text(
            "class Wrong:\n"
            "    @classmethod\n"
            "    def build(cls, interface, *, seed=0, checkpoint=None):\n"
            "        return cls()\n"
            "    def initial_state(self, batch_size):\n"
            "        return None\n"
            "    def act(self, observation, is_first, state, explore=False):\n"
            "        return [0.5] * len(is_first), state\n"
        )
        (tmp_path / "broken_at_hand.py").write_text("class Broken:\n    build = = 3\n")
        arguments = TINY[3:]
        assert command("eval", "--agent", "wrong_at_hand:Wrong", *arguments)[::2] == (
            1,
            "wrong_at_hand:Wrong, local: 0 of 40 episodes\n"
            "mazebench: agent 'wrong_at_hand:Wrong': expected act() to return integer actions, found float64\n",
        )
        status, _, errors = command("eval", "--agent", "broken_at_hand:Broken", *arguments)
        assert (status, errors.count("\n")) == (2, 1)
        assert "agent 'broken_at_hand:Broken': its module can't be imported: SyntaxError: invalid syntax" in errors


class TestSuite:
    def test_results_when_run_and_compared(self, command, tmp_path, monkeypatch):
        monkeypatch.setenv("COLUMNS", "80")
        quick = ("eval", "--suite", "quick", "--agent", "random", "--agent", "planner", "--out", "run")
        status, output, errors = command(*quick)
        assert status == 0
        assert "quick, random, planner: 840 of 840 episodes\n" in errors
        assert "random: suite quick" in output
        assert "results in run\n" in output
        parts = {path.name for path in (tmp_path / "run" / "planner").iterdir()}
        assert {"local-13", "hierarchical-13-k5", "flip-0.1", "warp-0.1", "noise-0.5"} <= parts
        assert all((path / "trajectories.npz").exists() for path in (tmp_path / "run" / "planner").iterdir())

        before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
        status, again, errors = command(*quick, "--resume")
        assert (status, errors) == (0, "")
        assert again.startswith("run: the run is finished\n")
        assert again.endswith(output)

        status, compared, errors = command("compare", "run/planner", "run/random")
        assert (status, errors) == (0, "")
        status, near, _ = command("compare", "run/planner/local-13", "run/random/local-13")
        assert status == 0
        for text in (output, compared, near):
            assert "…" not in text
            assert max(len(line.rstrip()) for line in text.splitlines()) <= 80
        assert [line.split()[0] for line in compared.splitlines()[3:]] == [
            *("local-13", "local-21", "hierarchical-13-k5", "flip-0.1", "warp-0.1", "noise-0.5")
        ]
        assert "hierarchical-13-k5 1.00 0.00 +1.00 [+0.84, +1.00]" in compared
        status, text, _ = command("compare", "run/planner/local-13", "run/random/local-13", "--json")
        assert list(json.loads(text)["by_distance"]) == ["2", "4", "6", "8", "10"]

        for arguments, said in [
            (
                ("run", "run/planner"),
                "run: expected one agent's results, found 2 agents'; name one of: run/random, run",
            ),
            (("run/planner", "run/random/local-13"), "expected results of the same parts, found local-13, "),
            (("run/planner/local-13", "run/planner/local-21"), "expected results of one size to compare, found 13 in"),
            (("run/planner/local-21", "run/planner/noise-0.5"), "expected results of one size to compare, found 21 in"),
            (
                ("run/planner/local-13", "run/planner/warp-0.1"),
                "expected the same episodes in run/planner/local-13 and",
            ),
        ]:
            status, _, errors = command("compare", *arguments)
            assert (status, errors.count("\n")) == (2, 1)
            assert said in errors
        assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


class TestRender:
    ARGUMENTS = ("render", "--agent", "planner", "--distances", "2", "--pixels", "96")

    def test_map_when_nothing_is_rendered(self, command, tmp_path):
        status, output, errors = command(*self.ARGUMENTS, "--view", "map", "--out", "new/map.png")
        assert (status, errors) == (0, "")
        assert output.startswith("new/map.png: planner reached the goal after ")
        assert cv2.imread(str(tmp_path / "new" / "map.png")).shape == (96, 96, 3)

    @pytest.mark.parametrize("perturbation", ["--map-flip", "--map-warp"])
    def test_map_when_perturbed(self, command, tmp_path, perturbation):
        pictures = []
        for strength in ("0", "0.2"):
            options = ("--view", "map", "--pixels", "260", perturbation, strength)
            assert command(*self.ARGUMENTS[:-2], *options, "--out", "map.png")[0] == 0
            pictures.append(cv2.imread(str(tmp_path / "map.png"))[10::20, 10::20].mean(axis=2) < 60)
        assert pictures[0].shape == (13, 13)
        assert 0 < (pictures[0] != pictures[1]).mean() < 0.6  # another map, drawn cell by cell

    def test_film_when_landmarks_stand_close(self, command, tmp_path):
        options = ("--task", "hierarchical", "--landmark-distance", "2", "--map-flip", "0.1", "--view", "map")
        status, output, _ = command("render", "--agent", "planner-closed-loop", *options, "--out", "map.png")
        assert status == 0
        assert "planner-closed-loop " in output

    @pytest.mark.parametrize(("suffix", "magic"), [("gif", b"GIF89a"), ("mp4", b"ftyp")])
    def test_film_when_of_the_map(self, command, tmp_path, suffix, magic):
        assert command(*self.ARGUMENTS, "--view", "map", "--out", f"film.{suffix}")[0] == 0
        assert magic in (tmp_path / f"film.{suffix}").read_bytes()[:16]
        frames = cv2.VideoCapture(str(tmp_path / f"film.{suffix}"))
        assert frames.read()[1].shape == (96, 96, 3)

    def test_picture_when_rendered_without_a_display(self, tmp_path):
        run = subprocess.run(
            [sys.executable, "-m", "mazebench", *self.ARGUMENTS, "--out", "x.png"],
            cwd=tmp_path,
            env={**os.environ, "MUJOCO_GL": "egl"},
            capture_output=True,
            text=True,
        )
        if "can't open a rendering context" in run.stderr:
            pytest.skip("no EGL here")
        assert (run.returncode, run.stderr) == (0, "")
        picture = cv2.imread(str(tmp_path / "x.png"))
        assert picture.shape == (96, 4 * 96, 3)
        views = np.split(picture, 4, axis=1)  # map, top, chase, egocentric
        assert all(view.std() > 5 for view in views)


def mjcf_walls(path: str, size: int) -> set[tuple[int, int]]:
    """The cells that the wall boxes of a model cover."""
    model = mujoco.MjModel.from_xml_path(path)
    cells = set()
    for index in range(model.ngeom):
        if model.geom_type[index] == mujoco.mjtGeom.mjGEOM_BOX:
            (x, y, _), (half_x, half_y, _) = model.geom_pos[index], model.geom_size[index]
            xs, ys = np.arange(x - half_x, x + half_x) + 0.5, np.arange(y - half_y, y + half_y) + 0.5
            points = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
            cells |= {tuple(cell) for cell in point_to_cell(points, size)}
    return cells
