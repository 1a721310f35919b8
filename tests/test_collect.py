"""Demonstrations: what is collected is what an environment gives, the same however it is collected."""

from __future__ import annotations

import importlib.util
import pathlib

import numpy as np
import pytest
from processes import run_python
from run_folders import Killed, files_of, kill_after

import mazebench
from mazebench.errors import InputError
from mazebench.evaluation.collect import collect_demonstrations
from mazebench.evaluation.collect_options import CollectOptions
from mazebench.evaluation.demonstrations import Demonstration, load_demonstrations
from mazebench.evaluation.eval_options import EvalOptions
from mazebench.tasks.task import Task

NEAR = Task.of("rebuilt", level=(1, 2), distances=(15, 16), kinds=("dfs", "rooms"), fresh=True)


def collect(folder: pathlib.Path, task: Task = NEAR, agent: str = "oracle", count: int = 3, **how) -> pathlib.Path:
    wanted = CollectOptions(episodes=count, format=how.pop("format", "npz"))
    collect_demonstrations(EvalOptions(agent=agent, task=task.asked, seed=how.pop("seed", 0)), wanted, folder, **how)
    return folder


def episodes_of(folder: pathlib.Path) -> list[Demonstration]:
    return [episode for path in sorted(folder.glob("*.npz")) for episode in load_demonstrations(path)]


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
        env = mazebench.make(**task.to_json())
        for episode in episodes_of(collect(tmp_path / "run", task, agent, seed=7)):
            arrays, leg = episode.arrays, 0
            observation, info = env.reset(seed=episode.seed)
            assert env.unwrapped.task.mazes[info["maze"]].name == episode.maze
            rules = env.unwrapped.runner.rules
            way_left = env.unwrapped.task.mazes[info["maze"]].distances(rules.episodes[0].goal).ravel()
            assert arrays["infos/privileged/way_left"][0] == episode.distance
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
                    told = [arrays[name][step] for name in ("rewards", "terminations", "truncations")]
                    assert told == [reward, terminated, truncated]
            assert terminated or truncated
            assert len(arrays["infos/context"]) == leg + 1
        env.close()

    def test_they_do_not_depend_on_how_many_run_side_by_side(self, collected, tmp_path):
        assert files_of(collect(tmp_path / "run", num_envs=1)) == files_of(collected)

    def test_the_seed_is_that_of_the_first(self, collected, tmp_path):
        later = episodes_of(collect(tmp_path / "run", count=2, seed=1))
        for episode, same in zip(episodes_of(collected)[1:], later, strict=True):
            assert (episode.seed, episode.maze) == (same.seed, same.maze)
            for name, values in episode.arrays.items():
                np.testing.assert_array_equal(values, same.arrays[name])


class TestFolder:
    def test_a_run_that_was_killed_is_gone_on_with(self, tmp_path, monkeypatch):
        monkeypatch.setattr("mazebench.evaluation.collect.EPISODES_PER_FILE", 2)
        whole = files_of(collect(tmp_path / "whole", count=5))
        with pytest.raises(Killed):
            collect(tmp_path / "run", count=5, progress=kill_after(3))
        assert [path.name for path in sorted((tmp_path / "run").glob("*.npz"))] == ["episodes-000000.npz"]
        assert files_of(collect(tmp_path / "run", count=5, resume=True)) == whole

    def test_a_run_in_progress_or_something_else_is_left_alone(self, collected, tmp_path):
        with pytest.raises(InputError, match="holds a run already; go on with --resume or name another folder"):
            collect(collected)
        with pytest.raises(InputError, match="holds another run: its episodes is 3, this one's 4"):
            collect(collected, count=4, resume=True)
        (tmp_path / "thesis.tex").touch()
        with pytest.raises(InputError, match=r"expected an empty folder or one of a run, found 'thesis\.tex' in it"):
            collect(tmp_path)

    @pytest.mark.parametrize("task", [Task.of("building", split="eval"), Task.of("local", split="eval")])
    def test_the_split_eval_is_refused(self, tmp_path, task):
        with pytest.raises(InputError, match="expected split 'train' or 'dev' to collect from, found 'eval'"):
            collect(tmp_path / "run", task)
        assert not (tmp_path / "run").exists()

    def test_a_damaged_file_is_named(self, collected, tmp_path):
        path = tmp_path / "episodes-000000.npz"
        path.write_bytes((collected / path.name).read_bytes()[:2000])
        with pytest.raises(InputError, match="expected a file of demonstrations, found a damaged file"):
            load_demonstrations(path)


@pytest.mark.skipif(importlib.util.find_spec("minari") is None, reason="Minari is not installed")
class TestMinari:
    def test_the_data_set_has_the_same_episodes(self, collected, tmp_path):
        import minari

        folder = collect(tmp_path / "run", format="minari")
        assert {path.name for path in folder.iterdir()} == {"config.json", "data"}
        dataset = minari.MinariDataset(folder / "data")
        assert dataset.spec.dataset_id == "mazebench/rebuilt-1-2-oracle-v0"
        for episode, stored in zip(episodes_of(collected), dataset, strict=True):
            assert episode.arrays.keys() == arrays_of(stored).keys()
            for name, values in arrays_of(stored).items():
                np.testing.assert_array_equal(values, episode.arrays[name])
                assert values.dtype == episode.arrays[name].dtype
        told = next(iter(dataset.storage.get_episode_metadata([1])))
        assert (told["seed"], told["options"]["maze"]) == (1, episodes_of(collected)[1].maze)
        observation, _ = dataset.recover_environment().reset(seed=told["seed"])
        np.testing.assert_array_equal(observation["lidar"], dataset[1].observations["lidar"][0])
        before = files_of(folder)
        collect(folder, format="minari", resume=True)
        assert files_of(folder) == before


def arrays_of(stored) -> dict[str, np.ndarray]:
    """The arrays of an episode of Minari by the names that files of arrays have."""
    of_steps = {name: getattr(stored, name) for name in ("actions", "rewards", "terminations", "truncations")}
    infos = {f"infos/{name}": stored.infos[name] for name in ("context", "leg")}
    privileged = {f"infos/privileged/{name}": values for name, values in stored.infos["privileged"].items()}
    observations = {f"observations/{name}": values for name, values in stored.observations.items()}
    return of_steps | infos | privileged | observations


def test_the_command_takes_the_options_of_evaluations(tmp_path):
    options = ("--track", "building", "--distances", "15", "--episodes", "2", "--format", "npz", "--out", "run")
    printed = run_python("-m", "mazebench", "collect", "--agent", "oracle", *options, cwd=tmp_path).stdout
    assert printed == "2 episodes in run\n"
    assert len(episodes_of(tmp_path / "run")) == 2


def test_without_minari_arrays_are_written(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert CollectOptions().format_in_use == "npz"
    with pytest.raises(InputError, match=r"--format minari needs Minari, which the extra \[minari\] brings"):
        _ = CollectOptions(format="minari").format_in_use
