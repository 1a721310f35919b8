"""`mazebench check-map`: its words, files and page, in a building in which a door has closed since the old map."""

from __future__ import annotations

import csv
import json
import re
import shutil
import subprocess

import numpy as np
import pytest
from browser import CHROMIUM, Browser
from faults import COMMAND
from simple_mazes import field

from mazebench.evaluation.map_check import plan_check
from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze
from mazebench.maps.readers.ros import write_ros_map
from mazebench.results.reading import EPISODES
from mazebench.tasks.task import Task
from mazebench.tasks.task_options import TaskOptions
from mazebench.tasks.trials import spread_trials

ORIGIN = (-5.0, 2.0, 0.0)  # m, of both maps
DOOR = (-5.0 + 15.5, 2.0 + 17.5)  # of the cell in row 13 and column 15 of 31
TRIPS = 12


def rooms(*doors: int) -> Maze:
    """Returns a room left and a room right of a wall in column 15 of 31, with doors in these rows."""
    walls = field(31).walls.copy()
    walls[:, 15] = True
    walls[list(doors), 15] = False
    return Maze(walls, "rooms")


def write_maps(folder) -> tuple[str, ...]:
    """Writes both maps, and returns the arguments of a check of the old one."""
    for name, doors in (("old", (13, 29)), ("new", (29,))):
        write_ros_map(rooms(*doors), folder / f"{name}.yaml", ORIGIN)
    paths = ("--mazes", str(folder / "new.yaml"), "--shown", str(folder / "old.yaml"))
    return (*paths, "--cell-size", "1", "--trips", str(TRIPS), "--workers", "0")


@pytest.fixture(scope="module")
def checked(tmp_path_factory):
    """The folder of a finished check, the arguments that made it, and what was printed."""
    folder = tmp_path_factory.mktemp("check")
    arguments = ("check-map", *write_maps(folder), "--out", str(folder / "check"))
    run = subprocess.run([COMMAND, *arguments], text=True, capture_output=True, check=False)
    assert run.returncode == 0, run.stderr
    return folder / "check", arguments, run.stdout


def records_of(folder, part):
    return [json.loads(line) for line in (folder / "navigator" / part / EPISODES).read_text().splitlines()]


def numbers_of(folder):
    return json.loads((folder / "check.json").read_text())["navigator"]


class TestAnswer:
    def test_all_maps_have_the_same_trips(self, checked):
        parts = [records_of(checked[0], part) for part in ("old-map", "right-map", "no-map")]
        for name in ("maze", "start", "goal", "seed", "shortest_path", "oracle_steps"):
            assert len({json.dumps([record[name] for record in part]) for part in parts}) == 1
        distances = [record["distance"] for record in parts[0]]
        assert len(distances) == TRIPS == len(set(distances))  # from 15 to 40 m
        assert min(distances) < 20
        assert max(distances) > 30

    def test_the_first_line_has_the_numbers_of_the_records(self, checked):
        old, right, none = (records_of(checked[0], part) for part in ("old-map", "right-map", "no-map"))
        assert all(record["success"] for part in (old, right, none) for record in part)
        metres, seconds, without = (
            np.array([mine[name] - its[name] for mine, its in zip(part, right, strict=True)])
            for part, name in ((old, "path_length"), (old, "steps"), (none, "path_length"))
        )
        found, said = numbers_of(checked[0]), checked[2]
        assert found["old"]["metres"]["value"] == pytest.approx(metres.mean())
        assert found["old"]["seconds"]["value"] == pytest.approx(0.16 * seconds.mean())
        assert found["old"]["tenth"] == pytest.approx(np.quantile(metres, 0.9))
        assert found["none"]["metres"]["value"] == pytest.approx(without.mean())
        one, two, three = (f"{round(each.mean(), 1):g}" for each in (metres, 0.16 * seconds, without))
        assert f"needs {one} m ({two} s) more per trip" in said
        assert f"all {TRIPS} arrive. Without a map: {three} m" in said
        assert f"Verdict: {found['verdict']}." in said

    def test_the_time_is_said_before_it_begins(self, checked):
        assert re.match(rf"{TRIPS} trips with 3 maps: about \d+ min\n", checked[2])

    def test_trips_are_spread_over_buildings_and_distances(self):
        mazes = [Maze(rooms(29).walls, name) for name in "abcd"]
        trials = spread_trials(Task.of("building", mazes=mazes, split="eval"), 10)
        assert [trial.episode.maze for trial in trials] == [0, 0, 0, 1, 1, 1, 2, 2, 3, 3]
        assert len({trial.distance for trial in trials}) >= 9
        again = spread_trials(Task.of("building", mazes=mazes, split="eval"), 10, seed=1)
        assert [each.distance for each in again] == [each.distance for each in trials]
        assert again != trials


class TestPlaces:
    def test_the_closed_door_is_named_where_it_is_on_the_map(self, checked):
        folder, _, said = checked
        first = numbers_of(folder)["places"][0]
        assert first["point"] == pytest.approx(DOOR)
        assert first["kind"] == "closed"
        old, right = records_of(folder, "old-map"), records_of(folder, "right-map")
        through = [number for number, each in enumerate(old) if each["blocked"]]
        assert sorted(first["trips"]) == through  # nothing else is closed
        lost = [old[number]["path_length"] - right[number]["path_length"] for number in through]
        assert first["metres"] == pytest.approx(sum(lost))
        assert f"  (10.5, 19.5) m: closed on the map's way of {len(through)} of {TRIPS} trips, " in said
        rows = list(csv.DictReader((folder / "trouble.csv").open()))
        assert [float(rows[0][name]) for name in ("x", "y", "trips")] == [*DOOR, len(through)]

    def test_figures_are_files(self, checked):
        names = {path.name for path in (checked[0] / "figures").iterdir()}
        assert names == {"navigator-new.png", "navigator-new.pdf"}


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    if CHROMIUM is None:
        pytest.skip("no Chromium is installed")
    with Browser(tmp_path_factory.mktemp("profile")) as browser:
        yield browser


class TestPage:
    def test_it_opens_at_the_trips_of_the_worst_place_with_map_and_path(self, checked, browser):
        folder, _, said = checked
        browser.errors.clear()
        browser.open(folder / "index.html")
        browser.wait_for("document.getElementById('clock').value.startsWith('step')")
        first = numbers_of(folder)["places"][0]
        text = "document.getElementById('{}').{}".format
        assert browser.run(text("count", "textContent")) == f"{len(first['trips'])} of {TRIPS} episodes"
        assert browser.run(text("episodes", "value")) == str(first["trips"][0])
        assert browser.run(text("shown-caption", "textContent")) == "The map that the agent was shown"
        assert browser.run(text("driven-caption", "textContent")) == "The maze, and the path driven in it"
        assert browser.run("document.querySelector('.answer').textContent") in said
        agents = browser.run("[...document.getElementById('agent').options].map(o => o.text)")
        assert agents == [f"navigator, {name}" for name in ("old map", "right map", "no map")]
        assert browser.errors == []

    def test_a_link_in_the_table_opens_the_trips_of_its_place(self, checked, browser):
        browser.open(checked[0] / "index.html")
        browser.wait_for("document.getElementById('clock').value.startsWith('step')")
        browser.run("document.getElementById('group').value = ''")
        browser.run("document.getElementById('group').dispatchEvent(new Event('change'))")
        assert browser.run("document.getElementById('count').textContent") == f"{TRIPS} of {TRIPS} episodes"
        browser.run("document.querySelector('.spots a').click()")
        browser.wait_for("document.getElementById('group').value.startsWith('1: (10.5, 19.5)')")
        browser.run("document.getElementById('agent').value = '2'")
        browser.run("document.getElementById('agent').dispatchEvent(new Event('change'))")
        browser.wait_for("document.getElementById('shown-caption').textContent.includes('hidden from the agent')")
        assert browser.errors == []


class TestRuns:
    def test_resume_plays_what_is_missing_and_gives_the_same_files(self, checked, command, tmp_path):
        folder, arguments, said = checked
        shutil.copytree(folder, tmp_path / "check")
        shutil.rmtree(tmp_path / "check" / "navigator" / "no-map")
        kept = tmp_path / "check" / "navigator" / "old-map" / EPISODES
        before = kept.stat().st_mtime_ns
        status, again, _ = command(*arguments[:-1], tmp_path / "check", "--resume")
        assert status == 0
        assert kept.stat().st_mtime_ns == before
        for name in ("check.json", "trouble.csv", f"navigator/no-map/{EPISODES}"):
            assert (tmp_path / "check" / name).read_bytes() == (folder / name).read_bytes()
        assert again.splitlines()[1:-1] == said.splitlines()[1:-1]

    def test_resume_with_other_trips_is_refused(self, checked, command):
        folder, arguments, _ = checked
        for other in (("--trips", str(TRIPS - 1)), ("--seed", "1")):
            status, _, errors = command(*arguments, "--resume", *other)
            assert status == 2
            assert f"{folder}: holds another run" in errors.replace("/navigator/old-map", "")

    def test_changed_buildings_have_the_frame_of_their_plan(self, tmp_path):
        house = Maze(generate("hospital", 41, np.random.default_rng(7)).walls, "plan")
        write_ros_map(house, tmp_path / "plan.yaml", ORIGIN)
        check = plan_check(TaskOptions(mazes=str(tmp_path / "plan.yaml"), cell_size=1.0), 1, 8)
        assert [each.origin for each in check.older] == [ORIGIN] * 4
        assert all((each.walls == house.walls).all() for each in check.older)
        assert all((each.maze.walls != house.walls).any() for each in check.older)
        assert [trial.episode.maze for trial in check.trials] == [0, 0, 1, 1, 2, 2, 3, 3]

    def test_a_small_building_has_the_longer_half_of_its_distances(self, tmp_path):
        for name in ("old", "new"):
            write_ros_map(field(9), tmp_path / f"{name}.yaml")
        paths = {name: str(tmp_path / f"{file}.yaml") for name, file in (("mazes", "new"), ("shown", "old"))}
        check = plan_check(TaskOptions(**paths, cell_size=1.0), None, 12)
        assert {trial.distance for trial in check.trials} == set(range(6, 11))
        check = plan_check(TaskOptions(**paths, cell_size=1.0, distances=(3,)), None, 12)
        assert {trial.distance for trial in check.trials} == {3}

    @pytest.mark.parametrize(
        ("words", "said"),
        [
            ("--mazes new.yaml", "expected an old map (--shown) or a strength of made changes (--changed), found n"),
            ("--mazes new.yaml --shown old.yaml --changed 1", "(--changed), found both"),
            ("--shown old.yaml", "expected mazes of your own beside it, found none"),
            ("--changed 1", "expected a map of the building (--mazes), found none"),
            ("--mazes gone.yaml --shown old.yaml", "gone.yaml"),
            ("--mazes . --changed 1", "Is a directory"),
            ("--mazes hall.yaml --changed 1", "so open that an old map costs nothing; found 0.0"),
            ("--mazes new.yaml --shown old.yaml --agent nobody", "nobody"),
            ("--mazes new.yaml --shown old.yaml --trips 1", "trips"),
            ("--mazes new.yaml --shown old.yaml --out full", "full: expected an empty folder or a suite's, found 'x'"),
        ],
    )  # fmt: skip
    def test_bad_input_gets_one_line(self, command, tmp_path, words, said):
        write_maps(tmp_path)
        write_ros_map(field(41), tmp_path / "hall.yaml")
        (tmp_path / "full").mkdir()
        (tmp_path / "full" / "x").touch()
        status, _, errors = command("check-map", *words.split(), *() if "--out" in words else ("--out", "check"))
        assert status == 2
        assert said in errors.splitlines()[-1]
        assert not (tmp_path / "check").exists()
