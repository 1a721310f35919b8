"""The reports of agents: where they say that they are on the map that is shown, and notes."""

from __future__ import annotations

import math
import shutil

import numpy as np
import pytest
from mazebench_agents.navigator import Navigator
from run_folders import Killed, kill_after
from simple_mazes import field

import mazebench
from mazebench.agent import Agent, Report, SingleAgent
from mazebench.evaluation.checked_agent import AgentError
from mazebench.maps.kinds import generate
from mazebench.report.episodes import join_episodes, read_results
from mazebench.report.tables import build_tables
from mazebench.results.metrics import RECALLS
from mazebench.results.reading import load_result
from mazebench.tasks.context import GLOBAL_MAP

HOUSE = generate("house", 31, np.random.default_rng(0), "house")
NAMES = [metric.name for metric in RECALLS]
REPORTED = (*NAMES, "notes")
ON_TRACKS = {"mazes": (HOUSE,), "distances": (15,), "episodes_per_distance": 4}


def on_map(walls: np.ndarray, shown: np.ndarray, pose: np.ndarray) -> list[float]:
    """Returns a pose in cells of 1 m on the map that shows `walls` mirrored, if at all, and then turned."""
    size, (x, y, yaw) = len(walls), pose.tolist()
    for is_mirrored in (False, True):
        turned, where = (walls[:, ::-1], [size - x, y, math.pi - yaw]) if is_mirrored else (walls, [x, y, yaw])
        for _ in range(4):
            if np.array_equal(turned, shown):
                return where
            turned, where = np.rot90(turned), [size - where[1], where[0], where[2] + math.pi / 2]
    raise AssertionError("expected one of the eight ways in which the map may lie")


class Truthful(Agent):
    """Reports the true pose, perhaps shifted (m) and turned (rad), and drives at random."""

    needs_truth = True
    shift, turn = 0.0, 0.0

    def initial_state(self, batch_size):
        return np.full((batch_size, 3), np.nan)

    def act(self, inputs, state, explore=False):
        maps = inputs.observation["context"][:, GLOBAL_MAP] > 0.5
        for slot in np.flatnonzero(inputs.active):
            state[slot] = on_map(inputs.truth.walls[slot], maps[slot], inputs.truth.pose[slot])
        actions = [np.random.default_rng(int(1000 * abs(x))).choice([0, 0, 2, 4]) for x in inputs.truth.pose[:, 0]]
        return np.array(actions), state

    def report(self, state):
        return Report(state + np.array([self.shift, 0.0, self.turn]))


class Shifted(Truthful):
    shift = 2.0


class Turned(Truthful):
    turn = math.radians(40)


class Doubtful(SingleAgent):
    """Drives against a wall, knows its pose in every second step, and counts steps."""

    def __init__(self):
        self.steps = 0

    def act(self, observation):
        self.steps, self.pose = self.steps + 1, observation["state"][[0, 1, 5]]
        return 1

    def report(self):
        return Report(self.pose if self.steps % 2 else None, {"steps": self.steps})


class Silent(Navigator):
    """The navigator without its reports."""

    report = Agent.report


@pytest.mark.parametrize(("agent", "expected"), [(Truthful, (1, 1)), (Shifted, (0, 0)), (Turned, (1, 0))])
@pytest.mark.parametrize("level", [1, 3])
def test_poses_count_on_the_map_that_is_shown_turned_and_mirrored(agent, expected, level):
    recall = mazebench.evaluate(agent, "building", level=level, **ON_TRACKS).overall.recall
    assert recall == dict(zip(NAMES, expected * 2, strict=True))


def test_a_step_without_a_pose_counts_as_missed_and_the_last_notes_are_kept(tmp_path):
    mazebench.evaluate(Doubtful, mazes=field(7), distances=(3,), time_limit=4, episodes_per_distance=2, out=tmp_path)
    for record in load_result(tmp_path).records:
        told = {name: record.model_extra[name] for name in REPORTED}
        assert told == dict(zip(NAMES, (0.5, 0.5, 0, 0), strict=True)) | {"notes": {"steps": 4}}


def test_a_bent_map_has_no_recall():
    class Anywhere(Truthful):
        def act(self, inputs, state, explore=False):
            return np.zeros(len(state), dtype=int), inputs.truth.pose

    options = {"kinds": ("house",), "num_mazes": 1, "distances": (15,), "episodes_per_distance": 1}
    assert mazebench.evaluate(Anywhere, "rough", level=3, **options).overall.recall == {}


@pytest.mark.parametrize(
    ("reported", "said"),
    [
        (Report(np.zeros((2, 2))), r"expected poses (x, y, yaw) of shape (1, 3) from report(), found float64 of shape"),
        (Report(np.array([[0, math.inf, 0]])), "expected poses in metres and rad, NaN where unknown from report(),"),
        (Report(notes=[1, 2]), "expected 1 notes from report(), found 2"),
        (Report(notes=[{1, 2}]), "expected notes that JSON can hold from report(), found Object of type set"),
        (None, "expected a Report from report(), found NoneType"),
        (Report(notes=["\ud800"]), "expected notes that JSON can hold from report(), found"),
    ],
)
def test_a_report_that_breaks_the_contract_is_named_in_one_line(reported, said):
    class Wrong(Truthful):
        def report(self, state):
            return reported

    with pytest.raises(AgentError) as caught:
        mazebench.evaluate(Wrong, mazes=field(7), distances=(3,), episodes_per_distance=1)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_reports_of_the_navigator_are_right_and_change_no_result(tmp_path):
    for agent in (Navigator, Silent):
        mazebench.evaluate(agent, "building", level=1, out=tmp_path / agent.__name__, **ON_TRACKS)
    found, silent = (load_result(tmp_path / name) for name in ("Navigator", "Silent"))
    assert set(found.summary.overall.recall.values()) == {1.0}
    differing = {"agent", *REPORTED}
    lines, expected = ([record.model_dump(exclude=differing) for record in each.records] for each in (found, silent))
    assert lines == expected
    assert "recall" not in (tmp_path / "Silent" / "summary.json").read_text()


def test_the_navigator_finds_how_the_map_lies():
    recall = mazebench.evaluate("navigator", "building", level=3, **ON_TRACKS).overall.recall
    assert recall["final_recall_1m_30deg"] == 1.0


def test_a_run_with_reports_goes_on(tmp_path):
    options = {"mazes": field(7), "distances": (2, 3), "time_limit": 4, "episodes_per_distance": 1, "out": tmp_path}
    mazebench.evaluate(Doubtful, **options)
    expected = (tmp_path / "episodes.jsonl").read_bytes()
    shutil.rmtree(tmp_path)
    with pytest.raises(Killed):
        mazebench.evaluate(Doubtful, **options, num_envs=1, progress=kill_after(1))
    assert "notes" in (tmp_path / "journal.jsonl").read_text()
    mazebench.evaluate(Doubtful, **options, resume=True)
    assert (tmp_path / "episodes.jsonl").read_bytes() == expected


def test_recall_is_printed_and_reported(command, tmp_path):
    options = ("--kinds", "house", "--num-mazes", 1, "--size", 13, "--distances", 3, "--sensors", "lidar")
    status, output, errors = command("eval", "--agent", "navigator", *options, "--out", tmp_path / "run")
    assert status == 0, errors
    assert "pose 1 m, 30 deg" in output
    assert "1.00, 1.00" in output.splitlines()[-4]
    tables = build_tables(join_episodes(read_results([tmp_path / "run"])))
    assert set(NAMES) <= set(tables[0].metrics)
