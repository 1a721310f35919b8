"""Evaluations from options to files: what they write, how they go on, and what they refuse."""

from __future__ import annotations

import os
import pathlib
import shutil
from typing import ClassVar

import numpy as np
import pytest
from processes import run_python
from run_folders import FEW, FILES, IMPORTS, RECORDED, Killed, files_of, kill_after, records_of, results_of, summary_of

from mazebench.agent import Agent, SingleAgent
from mazebench.errors import InputError, UnplayableError
from mazebench.evaluation.evaluate import evaluate
from mazebench.maps.benchmark import load_mazes
from mazebench.maps.kinds import generate
from mazebench.maps.text import write_text_maze
from mazebench.results.reading import load_result
from mazebench.tasks.task import Task, resolve_for_evaluation
from mazebench.tasks.task_options import TaskOptions
from mazebench.tasks.trials import frozen_trials

PERTURBATIONS = ("map_flip", "map_warp", "position_noise")


@pytest.fixture(scope="module")
def random_run(tmp_path_factory) -> pathlib.Path:
    folder = tmp_path_factory.mktemp("runs") / "random"
    evaluate("random", out=folder, **FEW)
    return folder


@pytest.fixture(scope="module")
def map_folder(tmp_path_factory) -> pathlib.Path:
    folder = tmp_path_factory.mktemp("maps")
    rng = np.random.default_rng(0)
    for name in "ab":
        write_text_maze(generate("dfs", 9, rng), folder / f"{name}.txt")
    return folder


class Ahead(SingleAgent):
    """Drives ahead."""

    def act(self, observation):
        return 0


class Witness(Agent):
    """Drives ahead and notes what it is given."""

    inputs: ClassVar[list] = []

    def initial_state(self, batch_size):
        return 0

    def act(self, inputs, state, explore=False):
        assert not explore
        copied = {name: np.array(getattr(inputs, name)) for name in ("new_episode", "new_context", "seed")}
        shapes = {key: (value.shape, value.dtype.name) for key, value in inputs.observation.items()}
        self.inputs.append((shapes, copied, inputs.truth, state))
        return np.zeros(len(inputs.seed), dtype=int), state + 1


class TestResults:
    def test_the_summary_tells_what_was_run_and_what_came_of_it(self, planner_run):
        summary = summary_of(planner_run)
        assert {path.name for path in planner_run.iterdir()} == RECORDED
        assert (summary["agent"], summary["benchmark"], summary["episodes"]) == ("planner", "paper", 40)
        assert Task.from_json(summary["task"]) == resolve_for_evaluation(TaskOptions(distances=FEW["distances"]))
        assert list(summary["by_distance"]) == ["1", "2"]
        for row in (summary["overall"], *summary["by_distance"].values()):
            assert row["success_rate"] == 1.0
            assert 0 < row["spl"] <= row["spl_grid"] <= 1
        assert (summary["overall"]["n"], summary["by_distance"]["2"]["n"]) == (40, 20)

    def test_a_task_that_was_made_before_is_evaluated(self):
        task = Task.of("rebuilt", level=2, split="dev", distances=(15,))
        summary = evaluate("random", task)
        assert (summary.task, summary.benchmark) == (task.options, "tracks")
        assert evaluate("random", summary.task).overall == summary.overall
        with pytest.raises(InputError, match="expected no options beside a Task, found size"):
            evaluate("random", task, size=31)

    def test_a_task_is_played_in_its_own_mazes_at_its_own_distances(self, tmp_path):
        path = tmp_path / "maze.txt"
        path.write_text("#####\n#...#\n###.#\n#...#\n#####\n")
        task = Task.of(mazes=path, distances=(2,))
        path.unlink()  # it can't be read again
        assert evaluate("oracle", task, episodes_per_distance=2).episodes == 2
        local = evaluate("random", Task.of(size=13), episodes_per_distance=1)
        assert (local.task.split, list(local.by_distance)) == ("train", ["1", "2", "3", "4", "5"])
        with pytest.raises(InputError, match="expected no fresh mazes in an evaluation"):
            evaluate("random", Task.of(fresh=True))

    def test_without_a_folder_the_summary_alone_is_left(self, planner_run, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
        summary = evaluate("planner", **FEW)
        assert summary.overall == load_result(planner_run).summary.overall
        assert list(tmp_path.iterdir()) == []

    def test_records_are_of_the_frozen_episodes_in_the_protocols_order(self, planner_run):
        trials = [trial for trial in frozen_trials("local", 13) if trial.distance <= 2][::5]
        names = [maze.name for maze in load_mazes(13, "eval")]
        records = records_of(planner_run)
        assert list(records[0]) == [
            *("agent", "task", "size", "split", "episode", "maze", "start", "goal", "distance", "success", "steps"),
            *("path_length", "shortest_path", "spl", "spl_grid", "seed", "leg", "oracle_steps", *PERTURBATIONS),
        ]
        for index, (record, trial) in enumerate(zip(records, trials, strict=True)):
            episode = trial.episode
            expected = {"episode": index, "maze": names[episode.maze], "seed": episode.seed, "leg": 1}
            expected |= {"start": list(episode.start), "goal": list(episode.goal)}
            expected |= {"distance": trial.distance, "shortest_path": trial.shortest_path}
            assert expected.items() <= record.items()


class TestAgents:
    def test_a_class_and_its_name_give_the_same_records(self, tmp_path):
        for out, agent in (("class", Ahead), ("name", f"{__name__}:Ahead")):
            assert evaluate(agent, out=tmp_path / out, **FEW).agent == f"{__name__}:Ahead"
        assert results_of(tmp_path / "class") == results_of(tmp_path / "name")

    def test_a_class_of_a_script_is_evaluated_in_this_process_only(self, tmp_path):
        script = f"{IMPORTS}from mazebench.evaluation.evaluate import evaluate\n"
        script += "class Mine(SingleAgent):\n    def act(self, observation):\n        return 0\n"
        script += "options = {'distances': (1,), 'episodes_per_distance': 1}\n"
        script += "print(evaluate(Mine, **options).agent, flush=True)\nevaluate(Mine, workers=2, **options)\n"
        done = run_python("-c", script, status=1, cwd=tmp_path)
        assert done.stdout == "__main__:Mine\n"
        assert (
            "InputError: expected a class that other processes can import by its name, found __main__:Mine"
            in done.stderr
        )

    def test_an_agent_is_given_what_the_contract_promises(self, monkeypatch):
        monkeypatch.setattr(Witness, "inputs", [])
        evaluate(Witness, num_envs=7, distances=(4,), episodes_per_distance=2)
        shapes, first, truth, state = Witness.inputs[0]
        assert shapes == {"state": ((7, 12), "float32"), "context": ((7, 4, 13, 13), "float32")}
        assert first["new_episode"].all()
        assert (truth, state) == (None, 0)
        assert [state for *_, state in Witness.inputs] == list(range(len(Witness.inputs)))
        assert sum(given["new_episode"].sum() for _, given, *_ in Witness.inputs) == 40
        for (_, before, *_), (_, given, *_) in zip(Witness.inputs, Witness.inputs[1:], strict=False):
            # The seed belongs to an episode, whose beginning is a new context.
            np.testing.assert_array_equal(before["seed"] != given["seed"], given["new_episode"])
            assert not (given["new_episode"] & ~given["new_context"]).any()

    def test_an_agent_that_needs_the_truth_is_given_it_and_labelled(self, monkeypatch):
        monkeypatch.setattr(Witness, "inputs", [])
        monkeypatch.setattr(Witness, "needs_truth", True)
        summary = evaluate(Witness, map_flip=0.3, position_noise=0.5, **FEW)
        assert summary.privileged
        assert not evaluate("random", **FEW).privileged
        truth = Witness.inputs[0][2]
        assert {tuple(walls.ravel()) for walls in truth.walls} == {
            tuple(maze.walls.ravel()) for maze in load_mazes(13, "eval")
        }
        trials = [trial.episode for trial in frozen_trials("local", 13) if trial.distance <= 2][::5]
        assert sorted(map(tuple, truth.goal.tolist())) == sorted(episode.goal for episode in trials)
        starts = {(column + 0.5, 13 - row - 0.5) for row, column in (episode.start for episode in trials)}
        assert set(map(tuple, truth.pose[:, :2].tolist())) == starts

    def test_an_agent_that_needs_a_sensor_is_given_it_as_if_by_the_option(self, tmp_path, monkeypatch):
        monkeypatch.setattr(Witness, "inputs", [])
        monkeypatch.setattr(Witness, "needs_sensors", ("lidar",))
        summary = evaluate(Witness, out=tmp_path / "declared", **FEW)
        assert Witness.inputs[0][0]["lidar"] == ((40, 32), "float32")
        assert summary.task.sensors == ("lidar",)
        evaluate(Witness, out=tmp_path / "given", sensors=("lidar",), **FEW)
        assert results_of(tmp_path / "declared") == results_of(tmp_path / "given")

    @pytest.mark.parametrize("agent", [Witness, "navigator", "neural-planner"])
    def test_an_agent_without_the_sensor_that_it_needs_is_refused(self, agent, monkeypatch):
        monkeypatch.setattr(Witness, "needs_sensors", ("lidar",))
        with pytest.raises(UnplayableError, match="expected the sensor lidar, found depth; add it: --sensors lidar"):
            evaluate(agent, "building", sensors="depth")


class TestSeeds:
    def test_agents_draw_otherwise_with_another_seed(self, random_run, tmp_path):
        evaluate("random", out=tmp_path, seed=1, **FEW)
        again, before = records_of(tmp_path), records_of(random_run)
        assert [record["seed"] for record in again] == [record["seed"] for record in before]
        assert [record["path_length"] for record in again] != [record["path_length"] for record in before]


class TestResume:
    @pytest.mark.parametrize("seed", range(2))
    def test_a_run_goes_on_wherever_it_was_killed(self, random_run, tmp_path, seed):
        rng = np.random.default_rng(seed)
        for _ in range(2):
            progress = kill_after(int(rng.integers(41)))
            num_envs = int(rng.integers(1, 41))
            with pytest.raises(Killed):
                evaluate("random", out=tmp_path, resume=True, num_envs=num_envs, progress=progress, **FEW)
            with (tmp_path / "journal.jsonl").open("r+b") as journal:
                size = journal.seek(0, os.SEEK_END)
                journal.truncate(max(0, size - int(rng.integers(500))))
        evaluate("random", out=tmp_path, resume=True, **FEW)
        assert {path.name for path in tmp_path.iterdir()} == RECORDED
        assert results_of(tmp_path) == results_of(random_run)
        assert summary_of(tmp_path)["overall"] == summary_of(random_run)["overall"]

    @pytest.mark.parametrize("num_files", range(4))
    def test_a_run_goes_on_wherever_its_end_was_killed(self, tmp_path, num_files):
        evaluate("random", out=tmp_path / "whole", record=True, **FEW)
        out = tmp_path / "out"
        with pytest.raises(Killed):
            evaluate("random", out=out, record=True, progress=kill_after(40), **FEW)
        for name in ("episodes.jsonl", "trajectories.npz", "summary.json")[:num_files]:
            shutil.copy(tmp_path / "whole" / name, out)
        (out / "summary.json.tmp").write_text('{"agent')
        calls = []
        evaluate("random", out=out, resume=True, progress=lambda ended, of: calls.append((ended, of)), **FEW)
        assert calls == [(40, 40)]
        assert results_of(out) == results_of(tmp_path / "whole")
        assert {path.name for path in out.iterdir()} == RECORDED

    def test_trajectories_that_are_wanted_later_are_recorded(self, tmp_path):
        out = tmp_path / "out"
        evaluate("random", out=out, record=False, **FEW)
        with pytest.raises(Killed):
            evaluate("random", out=out, resume=True, record=True, num_envs=3, progress=kill_after(5), **FEW)
        evaluate("random", out=tmp_path / "out", resume=True, record=True, **FEW)
        evaluate("random", out=tmp_path / "whole", record=True, **FEW)
        assert results_of(tmp_path / "out") == results_of(tmp_path / "whole")

    @pytest.mark.parametrize(("record", "files"), [(None, RECORDED), (False, FILES)])
    def test_few_episodes_are_recorded_unless_one_says_no(self, tmp_path, monkeypatch, record, files):
        evaluate("random", out=tmp_path / "out", record=record, **FEW)
        assert {path.name for path in (tmp_path / "out").iterdir()} == files
        monkeypatch.setattr("mazebench.evaluation.evaluate.MOST_RECORDED", 39)
        evaluate("random", out=tmp_path / "many", record=record, **FEW)
        assert {path.name for path in (tmp_path / "many").iterdir()} == FILES
        evaluate("random", out=tmp_path / "many", resume=True, **FEW)  # which has ended
        assert {path.name for path in (tmp_path / "many").iterdir()} == FILES


class TestOracle:
    """The oracle's steps, by which an episode is on time."""

    def test_frozen_ones_are_copied(self, planner_run):
        trials = [trial for trial in frozen_trials("local", 13) if trial.distance <= 2][::5]
        result = load_result(planner_run)
        assert [record.oracle_steps for record in result.records] == [trial.oracle_steps for trial in trials]
        on_time = [record.steps <= 2 * record.oracle_steps for record in result.records]
        assert result.summary.overall.on_time["2"] == np.mean(on_time)

    def test_it_plays_last_where_none_are_frozen(self, tmp_path):
        with pytest.raises(Killed):
            evaluate("planner", out=tmp_path / "planner", split="train", progress=kill_after(40), **FEW)
        evaluate("planner", out=tmp_path / "planner", split="train", resume=True, **FEW)
        summary = evaluate("oracle", out=tmp_path / "oracle", split="train", **FEW)
        assert summary.overall.on_time == {"1.25": 1.0, "2": 1.0}
        steps = [record["steps"] for record in records_of(tmp_path / "oracle")]
        for folder in tmp_path.iterdir():
            assert [record["oracle_steps"] for record in records_of(folder)] == steps

    def test_what_is_wrong_with_the_map_and_the_senses_does_not_change_them(self, tmp_path):
        wrong = {"map_flip": 0.3, "odometry_noise": 0.2, "sensors": ("lidar",), "hide": ("map",)}
        evaluate("random", out=tmp_path / "right", split="train", **FEW)
        evaluate("random", out=tmp_path / "wrong", split="train", **FEW | wrong)
        right, wrong = (
            [record["oracle_steps"] for record in records_of(tmp_path / name)] for name in ("right", "wrong")
        )
        assert right == wrong


class TestRefused:
    @pytest.mark.parametrize(
        ("agent", "changes", "named"),
        [
            ("planner", {}, "agent"),
            ("random", {"map_flip": 0.3}, "map_flip"),
            ("random", {"seed": 1}, "seed"),
        ],
    )
    def test_a_folder_that_holds_another_run_is_refused(self, random_run, tmp_path, agent, changes, named):
        shutil.copytree(random_run, tmp_path / "run")
        before = files_of(tmp_path)
        with pytest.raises(InputError, match=rf"run: holds another run: its {named} is .*, this one's "):
            evaluate(agent, out=tmp_path / "run", resume=True, **FEW | changes)
        assert files_of(tmp_path) == before

    @pytest.mark.parametrize("resume", [False, True])
    def test_a_folder_that_holds_other_things_is_refused(self, tmp_path, resume):
        (tmp_path / "thesis.tex").touch()
        with pytest.raises(InputError, match=r"expected an empty folder or one of a run, found 'thesis\.tex' in"):
            evaluate("random", out=tmp_path, resume=resume, **FEW)
        assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]

    def test_an_agent_whose_file_was_changed_is_refused(self, tmp_path, monkeypatch):
        monkeypatch.syspath_prepend(tmp_path)
        module = tmp_path / "changing_at_hand.py"
        module.write_text(f"{IMPORTS}class Mine(SingleAgent):\n    def act(self, observation):\n        return 0\n")
        evaluate("changing_at_hand:Mine", out=tmp_path / "out", **FEW)
        module.write_text(module.read_text().replace("return 0", "return 1"))
        with pytest.raises(InputError, match=r"out: holds another run: its agent's code was changed since"):
            evaluate("changing_at_hand:Mine", out=tmp_path / "out", resume=True, **FEW)

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({"pairs": "fixed"}, "expected pairs 'random' in an evaluation, found 'fixed'"),
            ({"speed": 2}, "unexpected keyword argument 'speed'; available: .*distances.*map_flip"),
            ({"num_envs": 0}, "expected num_envs of at least 1, found 0"),
        ],
    )
    def test_options_that_cannot_be_met_are_refused_and_nothing_is_written(self, tmp_path, options, message):
        with pytest.raises(InputError, match=f"{message}") as refused:
            evaluate(**{"agent": "random", "out": tmp_path / "out", **FEW, **options})
        assert "\n" not in str(refused.value)
        assert list(tmp_path.iterdir()) == []

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            (
                {"task": "rebuilt", "episodes_per_distance": 1},
                "expected episodes_per_maze for a track's frozen episodes, found episodes_per_distance 1",
            ),
            (
                {"episodes_per_maze": 1},
                "expected episodes_per_distance except for a track's frozen episodes, found episodes_per_maze 1",
            ),
            (
                {"task": "building", "kinds": "house", "num_mazes": 1, "episodes_per_maze": 5},
                "expected episodes_per_distance except for a track's frozen episodes, found episodes_per_maze 5",
            ),
            (
                {"task": "hierarchical", "episodes_per_distance": 2},
                "expected one episode in each maze of the hierarchical task, found episodes_per_distance 2",
            ),
        ],
    )
    def test_a_number_of_episodes_that_would_be_ignored_is_refused(self, tmp_path, options, message):
        with pytest.raises(InputError, match=f"^{message}$"):
            evaluate("random", out=tmp_path / "out", **options)
        assert list(tmp_path.iterdir()) == []

    def test_an_agent_that_cannot_play_leaves_no_folder(self, tmp_path):
        with pytest.raises(UnplayableError, match="its checkpoint reads maps of 13 x 13 only, found 15 x 15"):
            evaluate("mmn", out=tmp_path / "out", size=15, **FEW)
        assert list(tmp_path.iterdir()) == []


class TestMaps:
    def test_mazes_of_ones_own_come_from_a_folder_or_a_file(self, map_folder, tmp_path):
        options = {"distances": (3, 9), "episodes_per_distance": 4}
        summary = evaluate("planner", out=tmp_path / "out", mazes=str(map_folder), **options)
        assert (summary.task.split_in_results, summary.task.size, summary.episodes) == ("custom", 9, 16)
        assert summary.overall.success_rate == 1.0
        assert [record["maze"] for record in records_of(tmp_path / "out")] == ["a"] * 8 + ["b"] * 8
        assert evaluate("planner", mazes=str(map_folder / "b.txt"), size=9, **options).episodes == 8

    def test_a_run_does_not_go_on_in_mazes_that_were_changed(self, map_folder, tmp_path):
        maps = shutil.copytree(map_folder, tmp_path / "maps")
        evaluate("random", out=tmp_path / "out", mazes=str(maps), **FEW)
        shutil.copy(maps / "a.txt", maps / "b.txt")
        with pytest.raises(InputError, match="holds another run: its mazes_sha256 is"):
            evaluate("random", out=tmp_path / "out", mazes=str(maps), resume=True, **FEW)


def test_perturbations_leave_the_world_as_it_is(random_run, tmp_path):
    # The random agent looks at nothing, so that it drives the same ways.
    levels = {"map_flip": 0.3, "map_warp": 0.2, "position_noise": 0.5}
    summary = evaluate("random", out=tmp_path, **levels, **FEW)
    assert summary.task.perturbations == levels
    assert records_of(tmp_path) == [record | levels for record in records_of(random_run)]
