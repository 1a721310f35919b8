"""Mazes that are drawn: a fixed number of some kinds, or a new one for each episode."""

from __future__ import annotations

import dataclasses
import hashlib
import json

import gymnasium
import numpy as np
import pytest
from faults import TINY

import mazebench
from mazebench.constants import STEPS_PER_ACTION
from mazebench.envs.gym import MazeEnv
from mazebench.errors import InputError
from mazebench.evaluation.eval_options import eval_options
from mazebench.evaluation.plan import make_plan
from mazebench.maps import drawn
from mazebench.maps.drawn import FreshMazes, draw_mazes
from mazebench.maps.kinds import KNOWN
from mazebench.maps.text import format_maze
from mazebench.tasks.episode import sample_episode
from mazebench.tasks.task import Task
from mazebench.training.held_out import HeldOutEvaluation
from mazebench.training.loop import train
from mazebench.world.bodies import SLIDER

KINDS = ("dfs", "house")
CONTROLS = SLIDER.action_controls()


class TestDrawnMazes:
    def test_the_first_ones_depend_neither_on_their_number_nor_on_other_kinds(self):
        some = draw_mazes(("house",), 13, "train", 3)
        assert draw_mazes(("dfs", "house"), 13, "train", 5)[5:8] == some
        assert not set(some) & set(draw_mazes(("house",), 13, "dev", 3))
        assert [maze.name for maze in some] == [f"house-13-train-0{number}" for number in range(3)]
        assert {maze.kind for maze in some} == {"house"}

    def test_mazes_of_the_known_kinds_stay_as_they_are(self):
        # Results rest on them: a kind that is changed needs another name.
        text = "\n\n".join(map(format_maze, draw_mazes(KNOWN, 31, "train", 20)))
        digest = "beaddf60df22d69648901912dbfebb1880343786b340f539e72ccdcef49be5af"
        assert hashlib.sha256(text.encode("ascii")).hexdigest() == digest

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({"kinds": "office"}, "kind 'office': only the eval split has it"),
            ({"kinds": "dfs,office"}, "kind 'office': only the eval split has it"),
            ({"kinds": "attic"}, "unknown kinds 'attic'; available: cave, dfs, house"),
            ({"kinds": "dfs,dfs"}, "expected each kind once, found dfs, dfs"),
            ({"kinds": "dfs", "size": 14}, "kind 'dfs' makes mazes of odd sizes only, found size 14"),
            ({"kinds": "dfs", "split": "eval"}, "mazes that are drawn: expected split 'train' or 'dev', found 'eval'"),
            ({"kinds": "dfs", "mazes": "plan.txt"}, "expected mazes of your own or mazes that are drawn, found both"),
            ({"fresh": True, "num_mazes": 5}, "expected no num_mazes beside fresh, found 5"),
            ({"fresh": True, "start": (1, 1)}, "fresh mazes: expected no start, which may be a wall"),
            ({"fresh": True, "distances": 170}, "expected distances of at most"),
        ],
    )
    def test_options_that_do_not_fit_are_refused_in_one_line(self, options, message):
        with pytest.raises(InputError, match=message) as caught:
            Task.of(**options)
        assert "\n" not in str(caught.value)

    def test_an_evaluation_draws_other_mazes_than_a_training(self):
        options = eval_options("random", kinds="house", num_mazes=2, distances=(3,), episodes_per_distance=1)
        plan = make_plan(options)
        assert [maze.name for maze in plan.task.mazes] == ["house-13-dev-00", "house-13-dev-01"]
        assert plan.task.options.split_in_results == "custom"
        with pytest.raises(InputError, match="expected no fresh mazes in an evaluation"):
            make_plan(eval_options("random", fresh=True))


class TestFreshMazes:
    def test_a_maze_follows_from_its_number(self):
        mazes = FreshMazes(KINDS, 13)
        before = [mazes[number] for number in (0, 7, 2**31 - 1)]
        drawn._fresh_maze.cache_clear()
        assert [mazes[number] for number in (0, 7, 2**31 - 1)] == before
        assert {mazes[number].kind for number in range(20)} == set(KINDS)

    def test_a_body_moves_as_in_the_same_maze_given(self):
        spec = Task.of(kinds="obstacles", fresh=True)
        env = MazeEnv(spec, seed=5)
        env.reset()
        env.reset()
        episode = env.runner.episode
        compiled = MazeEnv(Task.of(mazes=spec.mazes[episode.maze], distances=1, time_limit=300))
        compiled.reset(options={"episode": dataclasses.replace(episode, maze=0)})
        rng = np.random.default_rng(0)
        for _ in range(60):
            action = int(rng.choice([0, 0, 0, 2, 4, 5]))
            for each in (env, compiled):
                each.simulation.set_controls(CONTROLS[action])
                each.simulation.step(STEPS_PER_ACTION)
            sensed = (SLIDER.state(each.simulation.data.sensordata) for each in (env, compiled))
            np.testing.assert_allclose(*sensed, rtol=0, atol=1e-9)

    def test_a_maze_that_is_too_small_for_the_distance_is_drawn_again(self):
        spec = Task.of(kinds="house", fresh=True, distances=max(each.diameter for each in small_houses()))
        episode = sample_episode(spec, np.random.default_rng(0))
        assert spec.mazes[episode.maze].distance(episode.start, episode.goal) == spec.distances[0]


def small_houses():
    return [FreshMazes(("house",), 13)[number] for number in range(10)]


class TestEnvironments:
    def test_an_episode_is_played_again_by_its_value(self):
        spec = Task.of(kinds=KINDS, fresh=True, sensors="lidar")
        env, other = MazeEnv(spec, seed=1), MazeEnv(spec, seed=2)
        first, _ = env.reset()
        other.reset()
        second, info = other.reset(options={"episode": env.runner.episode})
        assert info["maze"] == env.runner.episode.maze
        for name, value in first.items():
            np.testing.assert_array_equal(value, second[name], err_msg=name)

    def test_a_goal_environment_and_a_track_take_fresh_mazes(self):
        goal = gymnasium.make("mazebench/LocalGoal-13-v1", fresh=True)
        mazes = {goal.reset(seed=seed)[1]["maze"] for seed in range(3)}
        assert len(mazes) == 3
        env = mazebench.make_vec("rebuilt", 3, fresh=True, seed=0)
        _, infos = env.reset(seed=0)
        assert len(set(infos["maze"])) == 3


def options(**changes):
    values = {"agent": "mah", "overrides": TINY, "checkpoint_steps": 480, "eval_mazes": 1, "env_steps": 960}
    return {"kinds": KINDS, "fresh": True, "map_flip": 0.1, **values, **changes}


class TestTraining:
    def test_a_run_on_wrong_maps_of_fresh_mazes_that_is_resumed_equals_the_unbroken_one(self, tmp_path):
        train(**options(), out=tmp_path / "unbroken")
        train(**options(env_steps=480), out=tmp_path / "resumed")
        drawn._fresh_maze.cache_clear()
        train(**options(), out=tmp_path / "resumed", resume=True)
        for name in ("agent.safetensors", "training.safetensors", "random.json", "replay.npz"):
            files = [tmp_path / run / "checkpoints" / "000000000960" / name for run in ("unbroken", "resumed")]
            assert files[0].read_bytes() == files[1].read_bytes(), name
        config = json.loads((tmp_path / "resumed" / "config.json").read_text())
        assert config["task"]["kinds"] == list(KINDS)
        with pytest.raises(InputError, match="holds another run, differing in 'task'"):
            train(**options(fresh=False), out=tmp_path / "resumed", resume=True)

    def test_held_out_mazes_are_of_the_kinds_that_are_trained_in(self):
        evaluation = HeldOutEvaluation(Task.of(kinds=KINDS, fresh=True), 4)
        assert [maze.kind for maze in evaluation.task.mazes] == ["dfs", "house"] * 2

    def test_maps_of_your_own_are_trained_and_evaluated_in(self, tmp_path):
        path = tmp_path / "plan.txt"
        path.write_text(format_maze(draw_mazes(("house",), 13, "dev", 1)[0]))
        train(**options(mazes=str(path), kinds=(), fresh=False, env_steps=480), out=tmp_path / "run")
        assert "sha256" in json.loads((tmp_path / "run" / "config.json").read_text())["task"]["mazes"]
        assert HeldOutEvaluation(Task.of(mazes=str(path)), 4).task.mazes[0].name == "plan"
