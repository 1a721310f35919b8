"""Copies of environments in the middle of an episode, and states to go back to: they go on bit for bit."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import dm_env
import gymnasium
import numpy as np
import pytest
from gymnasium import wrappers
from processes import run_with_egl

import mazebench
from mazebench.envs.dm_control import Environment
from mazebench.envs.vector import MazeVectorEnv
from mazebench.errors import InputError
from mazebench.maps.kinds import generate
from mazebench.tasks.task import Task

TASKS: dict[str, dict[str, Any]] = {
    "local": {"time_limit": 60},
    "hierarchical": {"task": "hierarchical", "landmark_distance": 2, "time_limit": 9},
    "several goals": {"num_goals": 3, "time_limit": 20, "position_noise": 0.3},
    "perturbed": {"map_flip": 0.2, "map_warp": 0.1, "position_noise": 0.3, "time_limit": 40},
    "continuous": {"actions": "velocity", "time_limit": 40},
    "lidar": {"sensors": "lidar", "time_limit": 40},
    "fresh": {"kinds": ("dfs", "house"), "fresh": True, "sensors": "lidar", "num_goals": 2, "time_limit": 20},
    "rebuilt": {"task": "rebuilt", "level": (1, 2, 3)},
    "adrift": {"task": "adrift", "level": 3},
    "rough": {"task": "rough", "level": (1, 2, 3)},
}
OF_ALL_TASKS = pytest.mark.parametrize("options", TASKS.values(), ids=TASKS)


def through_pickle(value: Any) -> Any:
    return pickle.loads(pickle.dumps(value))  # noqa: S301


DUPLICATE = pytest.mark.parametrize("duplicate", [copy.deepcopy, through_pickle])


def actions_of(env: Environment, seed: int, count: int = 120) -> list[Any]:
    """Each one is repeated some times, so that the body meets walls at speed."""
    rng = np.random.default_rng(seed)
    spec = env.action_spec()
    if isinstance(spec, dm_env.specs.DiscreteArray):
        drawn = rng.choice(6, p=[0.5, 0.1, 0.1, 0.1, 0.1, 0.1], size=count)
    else:
        drawn = rng.uniform(-1, 1, size=(count, 3))
    return list(np.repeat(drawn, 3, axis=0)[:count])


def play(env: Environment, actions: list[Any]) -> list[dm_env.TimeStep]:
    """Steps through the episodes; after the end of one, a step begins the next."""
    return [env.step(action) for action in actions]


def in_the_middle(options: dict[str, Any]) -> tuple[Environment, list[Any]]:
    """An environment in the middle of an episode, and actions for it."""
    env = mazebench.load(seed=0, **options)
    env.reset()
    actions = actions_of(env, seed=0)
    play(env, actions[:20])
    return env, actions[60:]


def untimed(step: tuple[Any, ...]) -> tuple[Any, ...]:
    """The outcome of a step without the seconds that the wrapper counts."""
    step[4].pop("episode", None)
    return step


class TestCopies:
    @DUPLICATE
    @OF_ALL_TASKS
    def test_a_copy_goes_on_as_the_original_does(self, options, duplicate):
        env, actions = in_the_middle(options)
        copied = duplicate(env)
        expected = play(env, actions)
        np.testing.assert_equal(expected, play(copied, actions))
        np.testing.assert_array_equal(env.physics.full_state(), copied.physics.full_state())
        # What follows after another seed is the same, too.
        np.testing.assert_equal([env.reset(seed=7)], [copied.reset(seed=7)])
        np.testing.assert_equal(play(env, actions[:9]), play(copied, actions[:9]))

    @DUPLICATE
    @pytest.mark.parametrize("name", ["mazebench/Local-13-v1", "mazebench/LocalGoal-13-v1"])
    def test_a_gymnasium_environment_is_copied_with_its_wrappers(self, name, duplicate):
        env = wrappers.RecordEpisodeStatistics(gymnasium.make(name, position_noise=0.2, time_limit=30))
        env.reset(seed=4)
        actions = [int(action) for action in actions_of(mazebench.load(), seed=4)]
        for action in actions[:20]:
            env.step(action)
        copied = duplicate(env)
        for action in actions[20:29]:
            np.testing.assert_equal(*(untimed(each.step(action)) for each in (env, copied)))
        np.testing.assert_equal(env.reset(), copied.reset())
        for action in actions[29:40]:
            np.testing.assert_equal(*(untimed(each.step(action)) for each in (env, copied)))

    def test_renderers_and_cameras_are_not_copied_and_open_anew(self):
        run_with_egl("""
import copy, pickle
from mazebench.tasks.task import Task
from mazebench.envs.gym import MazeEnv
env = MazeEnv(Task.of(size=13, sensors=("egocentric",)), seed=0, render_mode="rgb_array")
env.reset(seed=0)
picture = env.render()
for copied in (copy.deepcopy(env), pickle.loads(pickle.dumps(env))):
    assert np.array_equal(copied.render(), picture)
    other = MazeEnv(env.task, seed=0)
    other.reset(seed=0)
    seen = [each.step(0)[0]["egocentric"] for each in (copied, other)]
    assert np.array_equal(*seen)
    copied.close()
""")

    @pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, pickle.dumps])
    def test_the_vector_environment_refuses(self, duplicate):
        envs = MazeVectorEnv(Task.of(size=13), 2)
        with pytest.raises(TypeError, match="MazeVectorEnv can't be copied or pickled; copy dm_env or Gymnasium"):
            duplicate(envs)


class TestStates:
    @OF_ALL_TASKS
    def test_an_environment_goes_back_to_a_state_as_often_as_asked(self, options):
        env, actions = in_the_middle(options)
        state = env.get_state()
        expected = play(env, actions)
        for _ in range(2):
            env.set_state(state)
            np.testing.assert_equal(expected, play(env, actions))

    @OF_ALL_TASKS
    def test_another_environment_of_the_task_goes_on_from_a_pickled_state(self, options):
        env, actions = in_the_middle(options)
        state = pickle.dumps(env.get_state())
        other = mazebench.load(seed=99, **options)
        play(other, actions[:31])
        other.set_state(pickle.loads(state))  # noqa: S301
        np.testing.assert_equal(play(env, actions), play(other, actions))

    @pytest.mark.parametrize("moment", ["before the first reset", "at the first step", "after the end"])
    def test_states_at_the_edges_of_an_episode(self, moment):
        env = mazebench.load(size=13, seed=0, time_limit=4, position_noise=0.1)
        actions = actions_of(env, seed=0)
        if moment != "before the first reset":
            env.reset()
        if moment == "after the end":
            while not env.needs_reset:
                env.step(4)
        state = env.get_state()
        expected = play(env, actions)
        env.set_state(state)
        assert env.needs_reset == (moment != "at the first step")
        np.testing.assert_equal(expected, play(env, actions))

    def test_a_state_of_other_mazes_is_refused(self):
        mazes = [generate("dfs", 13, np.random.default_rng(seed), f"maze-{seed}") for seed in range(2)]
        env, other = (mazebench.load(mazes=maze, seed=0) for maze in mazes)
        env.reset()
        with pytest.raises(InputError, match=r"^expected a state of .* with the same mazes, found one of maze-0$"):
            other.set_state(env.get_state())
