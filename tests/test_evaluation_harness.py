"""Evaluations from options to files, after a kill at any place too."""

from __future__ import annotations

import dataclasses
import itertools
import json
import os
import pathlib
import shutil
import sys

import numpy as np
import pytest

from mazebench.errors import InputError
from mazebench.evaluation.harness import EvalOptions, check_same_run, evaluate, is_finished
from mazebench.evaluation.protocol import frozen_trials
from mazebench.maps.benchmark import load_mazes
from mazebench.maps.generators import generate
from mazebench.maps.text import write_text_maze

RANDOM = EvalOptions("random", distances=(1, 2), episodes_per_distance=1)
PLANNER = dataclasses.replace(RANDOM, agent="planner")
FILES = {"config.json", "episodes.jsonl", "summary.json"}
PERTURBATIONS = ("map_flip", "map_warp", "position_noise")
METRICS = {"n", "success_rate", "success_rate_ci95", "spl", "spl_ci95", "spl_grid", "spl_grid_ci95"}

# Notes how it is called, and drives ahead.
WITNESS = """
import numpy as np

class Witness:
    calls = []

    def __init__(self, interface, seed):
        self.calls.append(("build", interface, seed))

    @classmethod
    def build(cls, interface, *, seed=0, checkpoint=None):
        return cls(interface, seed)

    @staticmethod
    def context_size(size):
        return 7

    def initial_state(self, batch_size):
        self.calls.append(("initial_state", batch_size))
        return 0

    def seed_episodes(self, seeds, mask):
        self.calls.append(("seed_episodes", seeds[mask].tolist()))

    def act(self, observation, is_first, state, explore=False):
        shapes = {key: (value.shape, value.dtype.name) for key, value in observation.items()}
        self.calls.append(("act", shapes, is_first.tolist(), state, explore))
        return np.zeros(len(is_first), dtype=int), state + 1
"""


@pytest.fixture(scope="module")
def random_run(tmp_path_factory) -> pathlib.Path:
    folder = tmp_path_factory.mktemp("runs") / "random"
    evaluate(RANDOM, folder)
    return folder


@pytest.fixture(scope="module")
def planner_run(tmp_path_factory) -> pathlib.Path:
    folder = tmp_path_factory.mktemp("runs") / "planner"
    evaluate(PLANNER, folder)
    return folder


@pytest.fixture(scope="module")
def map_folder(tmp_path_factory) -> pathlib.Path:
    folder = tmp_path_factory.mktemp("maps")
    rng = np.random.default_rng(0)
    for name in "ab":
        write_text_maze(generate("dfs", 9, rng), folder / f"{name}.txt")
    return folder


def records_of(folder: pathlib.Path) -> list[dict]:
    return [json.loads(line) for line in (folder / "episodes.jsonl").read_text().splitlines()]


def without(records: list[dict], *keys: str) -> list[dict]:
    return [{key: value for key, value in record.items() if key not in keys} for record in records]


def summary_of(folder: pathlib.Path) -> dict:
    return json.loads((folder / "summary.json").read_text())


class TestResults:
    def test_summary_when_planner_is_evaluated(self, planner_run):
        summary = summary_of(planner_run)
        assert {path.name for path in planner_run.iterdir()} == FILES
        assert list(summary) == [
            *("agent", "task", "size", "split", "benchmark", "episodes"),
            *("perturbation", "provenance", "overall", "by_distance"),
        ]
        assert list(summary.values())[:6] == ["planner", "local", 13, "eval", "v1", 40]
        assert summary["perturbation"] == dict.fromkeys(PERTURBATIONS, 0.0)
        assert list(summary["by_distance"]) == ["1", "2"]
        for row in (summary["overall"], *summary["by_distance"].values()):
            assert set(row) == METRICS
            assert row["success_rate"] == 1.0
            assert 0 < row["spl"] <= row["spl_grid"] <= 1
        assert (summary["overall"]["n"], summary["by_distance"]["2"]["n"]) == (40, 20)

    def test_provenance_when_planner_is_evaluated(self, planner_run):
        provenance = summary_of(planner_run)["provenance"]
        assert provenance["options"]["agent"] == "planner"
        assert provenance["options"]["distances"] == [1, 2]
        assert provenance["checkpoint_sha256"] is None
        assert provenance["packages"]["mujoco"] is not None
        assert len(provenance["benchmark_manifest_sha256"]) == 64

    def test_records_when_compared_with_frozen_trials(self, planner_run):
        trials = [trial for trial in frozen_trials("local", 13) if trial.distance <= 2][::5]
        names = [maze.name for maze in load_mazes(13, "eval")]
        records = records_of(planner_run)
        assert list(records[0]) == [
            *("agent", "task", "size", "split", "episode", "maze", "start", "goal", "distance", "success", "steps"),
            *("path_length", "shortest_path", "spl", "spl_grid", "seed", *PERTURBATIONS),
        ]
        for index, (record, trial) in enumerate(zip(records, trials, strict=True)):
            episode = trial.episode
            assert (record["episode"], record["maze"]) == (index, names[episode.maze])
            assert (record["start"], record["goal"]) == (list(episode.start), list(episode.goal))
            assert (record["distance"], record["shortest_path"]) == (trial.distance, trial.shortest_path)
            assert record["seed"] == episode.seed

    @pytest.mark.parametrize("run", ["random_run", "planner_run"])
    def test_spl_when_computed_from_the_record(self, run, request):
        records = records_of(request.getfixturevalue(run))
        for record in records:
            for key, shortest in (("spl", record["shortest_path"]), ("spl_grid", record["distance"])):
                expected = record["success"] * shortest / max(shortest, record["path_length"])
                assert record[key] == pytest.approx(expected, abs=1e-12)
            # Nobody is faster than 3.2 m/s, 0.16 s a step; who fails used up the time.
            assert record["path_length"] <= 0.512 * record["steps"] + 1e-6
            assert record["success"] or record["steps"] == 100
            if record["success"]:
                assert record["path_length"] >= record["shortest_path"] - 1e-6

    def test_summary_when_task_is_hierarchical(self, tmp_path):
        options = dataclasses.replace(PLANNER, task="hierarchical")
        summary = evaluate(options, tmp_path)
        assert (summary["task"], summary["episodes"]) == ("hierarchical", 20)
        assert summary["overall"]["success_rate"] == 1.0
        records = records_of(tmp_path)
        assert {tuple(record["start"] + record["goal"]) for record in records} == {(1, 11, 11, 1)}
        # Landmarks restart the clock.
        assert max(record["steps"] for record in records) > 100

    def test_summary_when_split_is_train(self, tmp_path):
        summary = evaluate(dataclasses.replace(PLANNER, split="train", distances=(3,)), tmp_path)
        assert (summary["split"], summary["episodes"], summary["overall"]["success_rate"]) == ("train", 20, 1.0)
        assert records_of(tmp_path)[0]["maze"] == "13-train-00"

    def test_progress_when_called(self, tmp_path):
        calls = []
        evaluate(RANDOM, tmp_path, progress=lambda done, of: calls.append((done, of)))
        assert (calls[0], calls[-1]) == ((0, 40), (40, 40))
        assert calls == sorted(calls)


class TestAgentAtHand:
    def test_agent_when_its_calls_are_noted(self, tmp_path, monkeypatch):
        (tmp_path / "witness_at_hand.py").write_text(WITNESS)
        monkeypatch.syspath_prepend(tmp_path)
        options = EvalOptions("witness_at_hand:Witness", distances=(4,), episodes_per_distance=2, seed=5)
        evaluate(options, tmp_path / "out", num_envs=7)
        calls = sys.modules["witness_at_hand"].Witness.calls
        (name, interface, seed), initial, first_seeds, first_act, *rest = calls
        assert (name, seed) == ("build", 5)
        assert (interface.task, interface.size, interface.context_size, interface.num_actions) == ("local", 13, 7, 6)
        assert initial == ("initial_state", 7)
        shapes = {"state": ((7, 12), "float32"), "context": ((7, 4, 7, 7), "float32")}
        assert first_act == ("act", shapes, [True] * 7, 0, False)
        assert not any(call[-1] for call in rest if call[0] == "act")  # it never explores
        seeds = [call[1] for call in [first_seeds, *rest] if call[0] == "seed_episodes"]
        assert sorted(itertools.chain(*seeds)) == sorted(record["seed"] for record in records_of(tmp_path / "out"))
        # Wherever an episode begins, its seed is told right before the first act.
        acts = [i for i, call in enumerate(calls) if call[0] == "act"]
        for i in acts[1:]:
            previous = calls[i - 1]
            assert sum(calls[i][2]) == (len(previous[1]) if previous[0] == "seed_episodes" else 0)


class TestSeed:
    def test_records_when_seed_differs(self, random_run, tmp_path):
        evaluate(dataclasses.replace(RANDOM, seed=1), tmp_path)
        again, before = records_of(tmp_path), records_of(random_run)
        # The frozen episodes stay, the agent's draws don't.
        assert [record["seed"] for record in again] == [record["seed"] for record in before]
        assert [record["path_length"] for record in again] != [record["path_length"] for record in before]


class TestResume:
    @pytest.mark.parametrize("folder", ["missing", "empty"])
    def test_run_when_there_is_nothing_to_resume(self, random_run, tmp_path, folder):
        if folder == "empty":
            (tmp_path / folder).mkdir()
        evaluate(RANDOM, tmp_path / folder, resume=True)
        assert (tmp_path / folder / "episodes.jsonl").read_bytes() == (random_run / "episodes.jsonl").read_bytes()

    @pytest.mark.parametrize("seed", range(6))
    def test_run_when_killed_at_an_arbitrary_place(self, random_run, tmp_path, seed):
        rng = np.random.default_rng(seed)
        shutil.copy(random_run / "config.json", tmp_path)
        lines = (random_run / "episodes.jsonl").read_bytes().splitlines(keepends=True)
        num_in_place = int(rng.integers(0, len(lines)))
        waiting = rng.permutation(np.arange(num_in_place, len(lines)))[: int(rng.integers(0, 20))]
        for name, indices in (("episodes.jsonl", range(num_in_place)), ("journal.jsonl", waiting)):
            half_a_line = lines[-1][: int(rng.integers(0, len(lines[-1]) - 1))]
            (tmp_path / name).write_bytes(b"".join(lines[i] for i in indices) + half_a_line)
        evaluate(RANDOM, tmp_path, resume=True, num_envs=int(rng.integers(1, 9)))
        assert {path.name for path in tmp_path.iterdir()} == FILES
        assert (tmp_path / "episodes.jsonl").read_bytes() == (random_run / "episodes.jsonl").read_bytes()
        assert summary_of(tmp_path)["overall"] == summary_of(random_run)["overall"]

    def test_run_when_killed_before_its_summary(self, random_run, tmp_path):
        shutil.copytree(random_run, tmp_path / "out")
        (tmp_path / "out" / "summary.json").rename(tmp_path / "out" / "summary.json.tmp")
        calls = []
        evaluate(RANDOM, tmp_path / "out", resume=True, progress=lambda done, of: calls.append((done, of)))
        assert calls == [(40, 40)]
        assert summary_of(tmp_path / "out") == summary_of(random_run)

    def test_run_when_killed_before_its_first_file(self, random_run, tmp_path):
        # write_json had not yet renamed it.
        (tmp_path / "config.json.tmp").write_text('{"rec')
        evaluate(RANDOM, tmp_path, resume=True)
        assert (tmp_path / "episodes.jsonl").read_bytes() == (random_run / "episodes.jsonl").read_bytes()


class TestOut:
    def test_run_when_folder_holds_it_already(self, random_run):
        before = {path.name: path.read_bytes() for path in random_run.iterdir()}
        with pytest.raises(InputError, match=r"holds a run already; go on with --resume or name another folder$"):
            evaluate(RANDOM, random_run)
        assert {path.name: path.read_bytes() for path in random_run.iterdir()} == before

    @pytest.mark.parametrize(
        ("change", "named"),
        [
            ({"agent": "planner"}, "record"),
            ({"size": 15}, "record"),
            ({"split": "train"}, "record"),
            ({"task": "hierarchical"}, "record"),
            ({"position_noise": 0.1}, "perturbation"),
            ({"map_flip": 0.1}, "perturbation"),
            ({"map_warp": 0.1}, "perturbation"),
            ({"distances": (1, 2, 3)}, "distances"),
            ({"episodes_per_distance": 2}, "episodes_per_distance"),
            ({"landmark_distance": 4}, "landmark_distance"),
            ({"seed": 1}, "seed"),
        ],
    )
    def test_run_when_folder_holds_another(self, random_run, change, named):
        before = {path.name: path.read_bytes() for path in random_run.iterdir()}
        for refusing in (
            lambda options: evaluate(options, random_run, resume=True),
            lambda options: check_same_run(options, random_run),
        ):
            with pytest.raises(InputError, match=rf"holds another run: its {named} is .*, this one's "):
                refusing(dataclasses.replace(RANDOM, **change))
        assert {path.name: path.read_bytes() for path in random_run.iterdir()} == before

    def test_run_when_folder_holds_the_same(self, random_run):
        check_same_run(RANDOM, random_run)
        assert is_finished(random_run)

    def test_run_when_folder_holds_other_things(self, tmp_path):
        (tmp_path / "thesis.tex").touch()
        for resume in (False, True):
            with pytest.raises(
                InputError, match=r"expected an empty folder or an evaluation's, found 'thesis\.tex' in"
            ):
                evaluate(RANDOM, tmp_path, resume=resume)

    def test_run_when_records_are_corrupted(self, random_run, tmp_path):
        shutil.copytree(random_run, tmp_path / "out")
        (tmp_path / "out" / "summary.json").unlink()
        lines = (tmp_path / "out" / "episodes.jsonl").read_text().splitlines()
        (tmp_path / "out" / "episodes.jsonl").write_text("\n".join([*lines[:9], lines[9][:50], *lines[10:]]) + "\n")
        with pytest.raises(InputError, match=r"episodes\.jsonl: expected a record in line 10, found b'"):
            evaluate(RANDOM, tmp_path / "out", resume=True)

    def test_out_when_below_a_file(self, tmp_path):
        (tmp_path / "file").touch()
        for out in (tmp_path / "file", tmp_path / "file" / "out"):
            with pytest.raises(InputError, match="can't write there: "):
                evaluate(RANDOM, out)

    @pytest.mark.parametrize(
        ("change", "message"),
        [
            ({"distances": (1, 99)}, "no two cells are 99 cells apart; the farthest are"),
            ({"distances": ()}, "expected distances of at least 1 cell"),
            ({"distances": (0,)}, "expected distances of at least 1 cell"),
            ({"episodes_per_distance": 0}, "expected episodes_per_distance of at least 1, found 0"),
            ({"agent": "nobody"}, "unknown agent 'nobody'; available: "),
            ({"task": "locl"}, "unknown task 'locl'; available: hierarchical, local"),
            ({"size": 14}, "unknown size '14'"),
            ({"checkpoint": "/none"}, "reads no checkpoint"),
            ({"map_warp": 0.3}, r"expected map_warp from 0 to 0\.25, found 0\.3"),
        ],
    )
    def test_out_when_options_are_refused(self, tmp_path, change, message):
        with pytest.raises(InputError, match=message):
            evaluate(dataclasses.replace(RANDOM, **change), tmp_path / "out")
        assert not os.path.lexists(tmp_path / "out")

    @pytest.mark.parametrize(
        "options", [{"num_envs": 0}, {"num_envs": -3}, {"workers": -1}], ids=lambda options: str(options)
    )
    def test_numbers_when_out_of_range(self, tmp_path, options):
        with pytest.raises(InputError, match=r"^expected (num_envs of at least 1|workers of at least 0), found "):
            evaluate(RANDOM, tmp_path / "out", **options)


class TestMaps:
    def test_run_when_maps_are_a_folder(self, map_folder, tmp_path):
        options = dataclasses.replace(PLANNER, maps=str(map_folder), distances=(3, 9), episodes_per_distance=4)
        summary = evaluate(options, tmp_path / "out")
        assert (summary["split"], summary["size"], summary["episodes"]) == ("custom", 9, 16)
        assert summary["overall"]["success_rate"] == 1.0
        assert [record["maze"] for record in records_of(tmp_path / "out")] == ["a"] * 8 + ["b"] * 8

    def test_run_when_maps_are_a_file(self, map_folder, tmp_path):
        options = dataclasses.replace(PLANNER, maps=str(map_folder / "b.txt"), size=9)
        assert evaluate(options, tmp_path)["episodes"] == 2

    def test_run_when_map_changed_before_resuming(self, map_folder, tmp_path):
        shutil.copytree(map_folder, tmp_path / "maps")
        options = dataclasses.replace(RANDOM, maps=str(tmp_path / "maps"))
        evaluate(options, tmp_path / "out")
        shutil.copy(tmp_path / "maps" / "a.txt", tmp_path / "maps" / "b.txt")
        with pytest.raises(InputError, match="holds another run: its mazes_sha256 is"):
            evaluate(options, tmp_path / "out", resume=True)

    def test_episodes_when_seed_differs(self, map_folder, tmp_path):
        episodes = {}
        for seed, name in ((0, "first"), (0, "again"), (1, "other")):
            options = dataclasses.replace(PLANNER, maps=str(map_folder), distances=(5,), seed=seed)
            evaluate(options, tmp_path / name)
            episodes[name] = (tmp_path / name / "episodes.jsonl").read_bytes()
        assert episodes["first"] == episodes["again"] != episodes["other"]

    def test_run_when_sizes_differ(self, map_folder, tmp_path):
        shutil.copytree(map_folder, tmp_path / "maps")
        write_text_maze(generate("dfs", 7, np.random.default_rng(0)), tmp_path / "maps" / "c.txt")
        with pytest.raises(InputError, match=r"^expected mazes of one size, found sizes \[7, 9\]$"):
            evaluate(dataclasses.replace(RANDOM, maps=str(tmp_path / "maps")), tmp_path / "out")


class TestPerturbations:
    @pytest.mark.parametrize(
        "change", [{"position_noise": 0.5}, {"map_flip": 0.3}, {"map_warp": 0.2}], ids=lambda change: next(iter(change))
    )
    def test_world_when_what_is_shown_is_perturbed(self, random_run, tmp_path, change):
        # The random agent doesn't look: what it drives in is the same.
        summary = evaluate(dataclasses.replace(RANDOM, **change), tmp_path)
        assert summary["perturbation"] == {**dict.fromkeys(PERTURBATIONS, 0.0), **change}
        records = records_of(tmp_path)
        assert without(records, *PERTURBATIONS) == without(records_of(random_run), *PERTURBATIONS)
        for record in records:
            assert {key: record[key] for key in PERTURBATIONS} == summary["perturbation"]

    @pytest.mark.parametrize(
        "change", [{"position_noise": 0.5}, {"map_flip": 0.3}, {"map_warp": 0.2}], ids=lambda change: next(iter(change))
    )
    @pytest.mark.parametrize("task", ["local", "hierarchical"])
    def test_planner_when_what_is_shown_is_perturbed(self, tmp_path, task, change):
        options = dataclasses.replace(PLANNER, task=task, distances=(5,), **change)
        summary = evaluate(options, tmp_path)
        assert 0 <= summary["overall"]["success_rate"] < 1
        for record in records_of(tmp_path):
            # The length is the driven one, not the one observed; per step of noise alone it would be over 0.5 m.
            assert record["path_length"] <= 0.512 * record["steps"] + 1e-6

    def test_planner_when_position_is_noisy(self, planner_run, tmp_path):
        evaluate(dataclasses.replace(PLANNER, position_noise=0.3), tmp_path)
        driven = [record["path_length"] for record in records_of(tmp_path)]
        assert driven != [record["path_length"] for record in records_of(planner_run)]
