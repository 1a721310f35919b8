"""The command line: what it writes, and one line with exit status 2 for bad input."""

from __future__ import annotations

import inspect
import json
import pathlib
import shutil

import cv2
import numpy as np
import pytest
import typer
from processes import run_python
from run_folders import IMPORTS, RECORDED, files_of, records_of, summary_of

from mazebench import __version__, cli
from mazebench.agent_loading import agent_names
from mazebench.commands.option_parameters import parse_numbers, takes_options
from mazebench.errors import InputError
from mazebench.evaluation.suites import SUITES, Part
from mazebench.maps.maze_files import read_maze
from mazebench.maps.text import format_maze
from mazebench.tasks.task_options import TaskOptions

COMMANDS = typer.main.get_command(cli.app).commands
FEW = ("--distances", "1,2", "--episodes-per-distance", "1")
RANDOM = ("eval", "--agent", "random")
TINY = (*RANDOM, *FEW)
TRAIN = ("train", "--agent", "mah", "--env-steps", "8")
PLAN = "#####\n#...#\n#.#.#\n#...#\n#####\n"


@pytest.fixture(scope="module")
def bad(tmp_path_factory) -> pathlib.Path:
    """A folder of things that can't be used, and of a small map, good.txt, that can."""
    folder = tmp_path_factory.mktemp("bad")
    (folder / "good.txt").write_text(PLAN)
    (folder / "marked.txt").write_text(PLAN.replace("#.#.#", "#.!.#"))
    (folder / "file").touch()
    (folder / "binary.png").write_bytes(np.random.default_rng(0).bytes(3000))
    return folder


def one_line(run: tuple[int, str, str], status: int = 2) -> str:
    """Returns the one line of errors of a command that ended with `status`."""
    found, _, errors = run
    assert (found, errors.count("\n")) == (status, 1), errors
    assert errors.startswith("mazebench: ")
    assert errors.endswith("\n")
    return errors


AGAIN = ("render", "--out", "x.png", "--view", "map", "--episode", "0", "--results")

# One of each kind of fault.
BAD_INPUT = [
    (("--frobnicate",), "No such option"),
    (("eval",), "Missing option '--agent'"),
    (("eval", "--agent", "nobody"), "unknown agent 'nobody'; available: "),
    ((*TINY, "--task", "locl"), "'locl' is not one of 'local', 'hierarchical'"),
    ((*TINY, "--map-warp", "0.3"), "expected map_warp from 0 to 0.25, found 0.3"),
    ((*TINY, "--distances", "one"), "expected distances like 1-3 or 2,3, found 'one'"),
    ((*TINY, "--agent", "planner"), "expected one --agent without --suite, found 2"),
    ((*RANDOM, "--suite", "papr"), "unknown suite 'papr'; available: doors, doors-dev, doors-no-map, llm"),
    ((*RANDOM, "--track", "adrift", "--map-flip", "0.1"), "'adrift': expected map_flip 0.0, found 0.1"),
    ((*TINY, "--out", "{bad}/file/out"), "file/out: can't write there: Not a directory"),
    ((*TINY, "--mazes", "{bad}/marked.txt"), "marked: expected '#*1@%' or a block for wall"),
    (("generate", "--kind", "pub"), "unknown kind 'pub'; available: cave, dfs, hospital, house, museum, obstacles, "),
    (("generate", "--mazes", "{bad}/binary.png"), "binary.png: expected a "),
    (("generate", "--mazes", "{bad}/good.txt", "--count", "2"), "expected a count of 1 beside --mazes, found 2"),
    (("train", "--agent", "mah"), "expected --minutes or --env-steps, found neither"),
    ((*TRAIN, "--set", "colour"), "expected --set KEY=VALUE, found 'colour'"),
    (("render", "--out", "film.avi"), "unknown suffix '.avi'; available: .gif, .mp4, .png"),
    (("render", "--out", "x.png", "--results", "{bad}"), "expected --results and --episode together, found one"),
    ((*AGAIN, "{bad}"), "expected a finished evaluation, found 'binary.png' in it"),
    ((*AGAIN, "{bad}", "--level", "2"), "--results has an agent and options of its own; found --level"),
]


class TestBadInput:
    @pytest.mark.parametrize(
        ("arguments", "said"), BAD_INPUT, ids=[" ".join(arguments)[-60:] for arguments, _ in BAD_INPUT]
    )
    def test_bad_input_is_refused_in_one_line_and_nothing_is_written(self, command, bad, tmp_path, arguments, said):
        before = sorted(bad.rglob("*"))
        assert said in one_line(command(*(argument.replace("{bad}", str(bad)) for argument in arguments)))
        assert list(tmp_path.iterdir()) == []
        assert sorted(bad.rglob("*")) == before

    def test_an_agents_faults_are_told_in_one_line(self, command, tmp_path):
        code = "class Wrong(SingleAgent):\n    def act(self, observation):\n        return 0.5\n"
        (tmp_path / "wrong_at_hand.py").write_text(IMPORTS + code)
        (tmp_path / "broken_at_hand.py").write_text("class Broken:\n    act = = 3\n")
        status, _, errors = command("eval", "--agent", "wrong_at_hand:Wrong", *FEW)
        assert (status, errors) == (
            1,
            "wrong_at_hand:Wrong, local: 0 of 40 episodes\n"
            "mazebench: agent 'wrong_at_hand:Wrong': expected 40 integer actions from act(), "
            "found float64 of shape (40,)\n",
        )
        said = "agent 'broken_at_hand:Broken' can't be imported: SyntaxError: invalid syntax"
        assert said in one_line(command("eval", "--agent", "broken_at_hand:Broken", *FEW))

    def test_the_program_is_called_mazebench_however_it_was_started(self, tmp_path):
        run_python("-m", "mazebench", *TINY, "--out", "run", cwd=tmp_path)
        assert summary_of(tmp_path / "run")["provenance"]["command"] == ["mazebench", *TINY, "--out", "run"]


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("7", (7,)),
        ("1-5,8,10", (1, 2, 3, 4, 5, 8, 10)),
        ("10,8,1-3,2-4", (1, 2, 3, 4, 8, 10)),
        (" 3 , 1-2 ", (1, 2, 3)),
    ],
)
def test_ranges_and_commas_give_sorted_numbers(text, numbers):
    assert parse_numbers("distances", text) == numbers


@pytest.mark.parametrize("text", ["", "1,", "1-", "1.5", "0-3", "5-1"])
def test_other_texts_are_no_numbers(text):
    with pytest.raises(InputError, match=r"^expected distances "):
        parse_numbers("distances", text)


def test_texts_are_split_at_commas_as_if_each_was_an_option():
    @takes_options(TaskOptions)
    def command(values):
        assert values["sensors"] == ("egocentric", "lidar")

    defaults = {name: parameter.default for name, parameter in inspect.signature(command).parameters.items()}
    for sensors in (["egocentric, lidar"], ["egocentric", "lidar"]):
        command(**{**defaults, "sensors": sensors})


class TestHelp:
    @pytest.mark.parametrize("name", sorted(COMMANDS))
    def test_each_command_has_a_page(self, command, name):
        status, output, errors = command(name, "--help")
        assert (status, errors) == (0, "")
        assert f" {name} [OPTIONS]" in output.splitlines()[0]

    def test_commands_version_and_everything_that_has_a_name_are_listed(self, command):
        assert command("--version") == (0, f"mazebench {__version__} (benchmarks paper and tracks, version 1)\n", "")
        status, output, errors = command()
        assert (status, errors) == (0, "")
        assert all(f"\n  {name} " in output for name in COMMANDS)
        status, output, errors = command("list")
        assert (status, errors) == (0, "")
        words = ("hierarchical", "obstacles", "13, 15, 17, 19, 21", "Local-13-v1", "six, four, velocity, diff")
        assert all(word in output for word in (*agent_names(), *words))


class TestGenerate:
    def test_mazes_are_written_in_all_formats_and_the_first_is_shown(self, command, tmp_path):
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
        assert [read_maze(tmp_path / "mine" / f"dfs-9-3-{i:03d}.png") for i in range(2)] == mazes

    def test_a_ros_map_is_written_and_read(self, command, tmp_path):
        options = ("--format", "txt,ros", "--cell-size", "0.5")
        assert command("generate", "--size", "9", *options, "--out", "ours")[0] == 0
        assert {path.suffix for path in (tmp_path / "ours").iterdir()} == {".txt", ".yaml", ".pgm"}
        source = "ours/dfs-9-0-000.yaml"
        assert command("generate", "--mazes", source, "--format", "txt,ros", "--out", "again")[::2] == (0, "")
        for suffix in ("txt", "yaml", "pgm"):
            written, again = (tmp_path / out / f"dfs-9-0-000.{suffix}" for out in ("ours", "again"))
            assert again.read_bytes() == written.read_bytes()
        assert read_maze(tmp_path / source).cell_size == 0.5
        said = one_line(command("generate", "--mazes", source, "--format", "ros", "--out", "ours"))
        assert "dfs-9-0-000.yaml: would overwrite the map that the maze is read from" in said


class TestEval:
    def test_results_are_written_and_told(self, command, tmp_path):
        status, output, errors = command(*TINY, "--out", "run")
        assert status == 0
        assert "random, local: 40 of 40 episodes\n" in errors  # plain lines where there is no terminal
        assert "resuming" not in output
        assert output.endswith("results in run\n")
        assert {path.name for path in (tmp_path / "run").iterdir()} == RECORDED

    def test_a_run_without_out_gets_a_folder_of_its_own(self, command, tmp_path):
        for _ in range(2):
            assert command(*TINY)[0] == 0
        folders = list((tmp_path / "results").iterdir())
        assert len(folders) == 2
        assert all(folder.name.startswith("random-local-") for folder in folders)

    def test_resume_goes_on_or_starts_anew_and_says_so(self, command, tmp_path):
        status, output, _ = command(*TINY, "--out", "run", "--resume")
        assert status == 0
        assert "nothing to resume in run; starting a new run\n" in output
        before = files_of(tmp_path)
        status, output, errors = command(*TINY, "--out", "run", "--resume")
        assert (status, errors) == (0, "random, local: 40 of 40 episodes\n")
        assert "resuming run\n" in output
        assert files_of(tmp_path) == before

    def test_a_suite_is_run_and_compared(self, command, tmp_path, monkeypatch):
        parts = ["local-21", "hierarchical-13-k5", "warp-0.1"]
        near, warped = TaskOptions(size=21, distances=(2, 3)), TaskOptions(map_warp=0.1, distances=(2,))
        tasks = (near, TaskOptions(task="hierarchical", landmark_distance=5), warped)
        monkeypatch.setitem(SUITES, "some", tuple(map(Part, parts, tasks, (1, None, 1))))
        some = ("eval", "--suite", "some", "--agent", "random", "--agent", "planner", "--out", "run")
        status, output, errors = command(*some)
        assert status == 0
        assert "some, random, planner: 160 of 160 episodes\n" in errors
        assert "random: suite some" in output
        assert [line.split()[0] for line in output.splitlines() if line.startswith(tuple(parts))] == parts * 2
        assert all((tmp_path / "run" / "planner" / part / "trajectories.npz").exists() for part in parts)

        before = files_of(tmp_path)
        status, again, _ = command(*some, "--resume")
        assert (status, again) == (0, f"resuming run\n{output}")
        status, compared, errors = command("compare", "run/planner", "run/random")
        assert (status, errors) == (0, "")
        status, near, _ = command("compare", "run/planner/local-21", "run/random/local-21")
        assert status == 0
        assert "A - B, SPL" in near
        assert "hierarchical-13-k5 1.00 0.00 +1.00 [" in compared
        status, text, _ = command("compare", "run/planner/local-21", "run/random/local-21", "--json")
        assert list(json.loads(text)["by_distance"]) == ["2", "3"]
        for a, b, said in [
            ("run", "run/planner", "run: expected one agent's results, found 2 agents'; name one of: run/random, run"),
            ("run/planner", "run/random/local-21", "expected results of the same parts, found local-21, "),
            ("run/planner/local-21", "run/planner/warp-0.1", "expected results of one size to compare, found 21 in"),
        ]:
            assert said in one_line(command("compare", a, b))
        assert files_of(tmp_path) == before


class TestRender:
    ARGUMENTS = ("render", "--agent", "planner", "--distances", "2", "--pixels", "96")

    def test_a_picture_is_the_last_moment_of_the_film_with_the_whole_path(self, command, tmp_path):
        for name in ("x.png", "x.mp4", "x.gif"):
            assert command(*self.ARGUMENTS, "--view", "map", "--out", name)[0] == 0
        assert (tmp_path / "x.gif").read_bytes().startswith(b"GIF89a")
        film = cv2.VideoCapture(str(tmp_path / "x.mp4"))
        frames = []
        while (read := film.read())[0]:
            frames.append(read[1].astype(int))
        picture = cv2.imread(str(tmp_path / "x.png"))
        differences = [np.abs(frame - picture).mean() for frame in frames]
        assert len(frames) > 3
        assert np.argmin(differences) == len(frames) - 1

    def test_the_map_is_the_one_that_the_agent_is_shown(self, command, tmp_path):
        pictures = []
        for strength in ("0", "0.2"):
            options = ("--view", "map", "--pixels", "260", "--map-warp", strength)
            assert command(*self.ARGUMENTS[:-2], *options, "--out", "map.png")[0] == 0
            pictures.append(cv2.imread(str(tmp_path / "map.png"))[10::20, 10::20].mean(axis=2) < 60)
        assert pictures[0].shape == (13, 13)
        assert 0 < (pictures[0] != pictures[1]).mean() < 0.6  # another map, drawn cell by cell

    def test_rays_are_drawn_on_the_true_maze(self, command, tmp_path):
        pictures = []
        for options in (("--view", "map"), ("--view", "lidar", "--sensors", "lidar", "--map-flip", "0.2")):
            assert command(*self.ARGUMENTS[:-2], *options, "--pixels", "260", "--out", "x.png")[0] == 0
            pictures.append(cv2.imread(str(tmp_path / "x.png")).astype(int))
        without, rays = pictures
        centres = np.s_[10::20, 10::20]
        np.testing.assert_array_equal((without < 60).all(axis=2)[centres], (rays < 60).all(axis=2)[centres])
        blue_on_floor = (rays[..., 0] > rays[..., 2] + 20) & (without.min(axis=2) > 250)
        assert 0 < blue_on_floor.mean() < 0.5

    def test_an_episode_of_results_is_run_again(self, command, planner_run, tmp_path):
        record = records_of(planner_run)[3]
        options = ("--results", planner_run, "--episode", "3", "--view", "map", "--out", "x.png")
        status, text, errors = command("render", *options)
        assert (status, errors) == (0, "")
        driven = f"reached the goal after {record['steps']} steps and {record['path_length']:.2f} m"
        assert text.startswith(f"x.png: planner {driven}")
        assert f"in maze {record['maze']}, from ({record['start'][0]}, {record['start'][1]}) to" in text
        said = "expected an episode from 0 to 39, found 40"
        assert said in one_line(command(*AGAIN[:-2], "40", "--results", planner_run))

    def test_an_episode_that_ends_otherwise_than_its_record_is_told(self, command, planner_run, tmp_path):
        shutil.copytree(planner_run, tmp_path / "changed")
        records = records_of(planner_run)
        lines = (json.dumps({**record, "steps": record["steps"] + 1}) + "\n" for record in records)
        (tmp_path / "changed" / "episodes.jsonl").write_text("".join(lines))
        said = f"found True after {records[0]['steps']}; the agent's code is the same"
        assert said in one_line(command(*AGAIN, "changed"), status=0)

    def test_views_are_rendered_without_a_display(self, tmp_path):
        arguments = ("-m", "mazebench", *self.ARGUMENTS, "--out", "x.png")
        run = run_python(*arguments, status=None, variables={"MUJOCO_GL": "egl"}, cwd=tmp_path)
        if "can't open a rendering context" in run.stderr:
            pytest.skip("no EGL here")
        assert (run.returncode, run.stderr) == (0, "")
        picture = cv2.imread(str(tmp_path / "x.png"))
        assert picture.shape == (96 + 6, 4 * 96, 3)  # with titles
        views = np.split(picture, 4, axis=1)  # map, top, chase, egocentric
        assert all(view.std() > 5 for view in views)
