"""Demonstrations: what is collected is what an environment gives, the same however it is collected."""

from __future__ import annotations

import pathlib
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from processes import run_python
from run_folders import Killed, kill_after

from mazebench.errors import InputError
from mazebench.evaluation.eval_options import EvalOptions, RunOptions
from mazebench.tasks.task import Task

minari = pytest.importorskip("minari")
from mazebench.evaluation.collect import collect_demonstrations  # noqa: E402  # which imports it

NEAR = Task.of("rebuilt", level=(1, 2), distances=(15, 16), kinds=("dfs", "rooms"), fresh=True)


def collect(folder: pathlib.Path, task: Task = NEAR, agent: str = "oracle", count: int = 3, **how) -> pathlib.Path:
    collect_demonstrations(EvalOptions(agent=agent, task=task.options, seed=how.pop("seed", 0)), count, folder, **how)
    return folder


def episodes_of(folder: pathlib.Path) -> Iterator[tuple[Any, dict[str, np.ndarray]]]:
    """Yields what is told of each episode, and its arrays by the names of docs/imitation.md."""
    dataset = minari.MinariDataset(folder)
    for number, stored in enumerate(dataset):
        (told,) = dataset.storage.get_episode_metadata([number])
        of_steps = {name: getattr(stored, name) for name in ("actions", "rewards", "terminations", "truncations")}
        infos = {f"infos/{name}": stored.infos[name] for name in ("context", "leg")}
        privileged = {f"infos/privileged/{name}": values for name, values in stored.infos["privileged"].items()}
        observations = {f"observations/{name}": values for name, values in stored.observations.items()}
        yield told, of_steps | infos | privileged | observations


def assert_same(episodes: Iterator, others: Iterator) -> None:
    for (told, arrays), (other_told, others_arrays) in zip(episodes, others, strict=True):
        assert (told["seed"], told["options"]["maze"]) == (other_told["seed"], other_told["options"]["maze"])
        for name, values in arrays.items():
            np.testing.assert_array_equal(values, others_arrays[name])


@pytest.fixture(scope="module")
def collected(tmp_path_factory) -> pathlib.Path:
    return collect(tmp_path_factory.mktemp("collected") / "run")


class TestEpisodes:
    @pytest.mark.parametrize(
        ("agent", "task"),
        [
            ("oracle", NEAR),
            ("planner", Task.of("hierarchical", size=13, landmark_distance=3)),
            ("random", Task.of("local", size=13, distances=(4,), pairs="fixed", position_noise=0.2)),
        ],
        ids=["track", "legs", "failures"],
    )
    def test_an_environment_plays_them_again_from_the_seed_and_the_actions(self, tmp_path, agent, task):
        env = minari.MinariDataset(collect(tmp_path / "run", task, agent, seed=7)).recover_environment()
        for told, arrays in episodes_of(tmp_path / "run"):
            leg = 0
            observation, info = env.reset(seed=int(told["seed"]))
            assert env.unwrapped.task.mazes[info["maze"]].name == told["options"]["maze"]
            rules = env.unwrapped.runner.rules
            way_left = env.unwrapped.task.mazes[info["maze"]].distances(rules.episodes[0].goal).ravel()
            assert arrays["infos/privileged/way_left"][0] == told["options"]["distance"]
            for step in range(len(arrays["actions"]) + 1):
                leg += step > 0 and info["is_first"]
                for name, value in observation.items():
                    if name != "context":
                        np.testing.assert_array_equal(value, arrays[f"observations/{name}"][step])
                assert arrays["infos/leg"][step] == leg
                np.testing.assert_array_equal(observation["context"], arrays["infos/context"][leg])
                np.testing.assert_array_equal([*info["position"], info["yaw"]], arrays["infos/privileged/pose"][step])
                assert arrays["infos/privileged/way_left"][step] == way_left[rules.cell[0]]
                if step < len(arrays["actions"]):
                    observation, reward, terminated, truncated, info = env.step(int(arrays["actions"][step]))
                    stored = [arrays[name][step] for name in ("rewards", "terminations", "truncations")]
                    assert stored == [reward, terminated, truncated]
            assert terminated or truncated
            assert len(arrays["infos/context"]) == leg + 1
        env.close()

    def test_each_step_has_its_context_if_asked(self, tmp_path, monkeypatch):
        task, name = Task.of("hierarchical", size=13, landmark_distance=3), "mazebench/hierarchical-13-planner-v0"
        collect(tmp_path / "run", task, "planner")
        collect(tmp_path / name / "data", task, "planner", context_per_step=True)
        monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
        dataset = minari.load_dataset(name)
        assert dataset.observation_space == dataset.recover_environment().observation_space
        for found, (_, arrays) in zip(dataset, episodes_of(tmp_path / "run"), strict=True):
            expected = arrays["infos/context"][arrays["infos/leg"]]
            np.testing.assert_array_equal(found.observations["context"], expected)
        torchrl = pytest.importorskip("torchrl.data.datasets.minari_data")
        replay = torchrl.MinariExperienceReplay(name, 8, root=tmp_path / "torchrl", load_from_local_minari=True)
        assert len(replay) == dataset.total_steps
        assert replay.sample()["observation", "context"].shape == (8, 4, 13, 13)

    def test_the_oracle_has_the_score_1_and_random_0(self, tmp_path):
        for agent, score in (("oracle", 1), ("random", 0)):
            dataset = minari.MinariDataset(collect(tmp_path / agent, Task.of("local", size=13), agent))
            returns = np.array([episode.rewards.sum() for episode in dataset])
            assert minari.get_normalized_score(dataset, returns).mean() == pytest.approx(score, abs=1e-6)

    def test_they_do_not_depend_on_how_many_run_side_by_side(self, collected, tmp_path):
        assert_same(episodes_of(collect(tmp_path / "run", run=RunOptions(num_envs=1))), episodes_of(collected))

    def test_the_seed_is_that_of_the_first(self, collected, tmp_path):
        later = list(episodes_of(collected))[1:]
        assert_same(iter(later), episodes_of(collect(tmp_path / "run", count=2, seed=1)))


class TestFolder:
    def test_a_run_that_was_killed_leaves_nothing(self, tmp_path):
        with pytest.raises(Killed):
            collect(tmp_path / "run", progress=kill_after(1))
        assert list(tmp_path.iterdir()) == []

    def test_a_folder_that_is_not_empty_is_left_alone(self, tmp_path):
        (tmp_path / "thesis.tex").touch()
        with pytest.raises(InputError, match=r"expected a new or an empty folder, found 'thesis\.tex' in it"):
            collect(tmp_path)

    @pytest.mark.parametrize("task", [Task.of("building", split="eval"), Task.of("local", split="eval")])
    def test_the_split_eval_is_refused(self, tmp_path, task):
        with pytest.raises(InputError, match="expected split 'train' or 'dev' to collect from, found 'eval'"):
            collect(tmp_path / "run", task)
        assert not (tmp_path / "run").exists()


def test_the_command_takes_the_options_of_evaluations(tmp_path):
    options = ("--track", "building", "--distances", "15", "--episodes", "2", "--out", "run")
    printed = run_python("-m", "mazebench", "collect", "--agent", "oracle", *options, cwd=tmp_path).stdout
    assert printed == "2 episodes in run\n"
    dataset = minari.MinariDataset(tmp_path / "run")
    assert (dataset.total_episodes, dataset.spec.dataset_id) == (2, "mazebench/building-1-oracle-v0")
