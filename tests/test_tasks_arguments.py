"""Refusals of the constructors of environments, each in one line."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

import mazebench
from mazebench.envs.dm_control import Environment
from mazebench.envs.gym import MazeEnv
from mazebench.envs.vector import MazeVectorEnv
from mazebench.errors import InputError
from mazebench.tasks.episode import Episode

ID = "mazebench/Local-13-v1"
MAKERS = {
    "load": mazebench.load,
    "make": lambda **options: gymnasium.make(ID, **options),
    "make_vec": lambda **options: gymnasium.make_vec(ID, **options),
}
SPEC = mazebench.Task.of(size=13)

WRONG_OPTIONS = [
    ("map_flip", "0.1", "expected map_flip of type float, found '0.1'"),
    ("seed", -1, "expected seed of at least 0, found -1"),
    ("seed", "a", "expected seed of type int | None, found 'a'"),
]
WRONG_IN = {
    "make": [
        ("render_mode", "bogus", "unknown render_mode 'bogus'; available: rgb_array"),
        ("camera", "nose", "unknown camera 'nose'; available: chase, egocentric, top"),
    ],
    "make_vec": [
        ("num_envs", 0, "expected num_envs of at least 1, found 0"),
        ("num_threads", -1, "expected num_threads of at least 0, found -1"),
        ("autoreset_mode", "Never", "unknown autoreset_mode 'Never'; available: Disabled, NextStep, SameStep"),
    ],
}
WRONG = [(maker, *wrong) for maker in MAKERS for wrong in WRONG_OPTIONS + WRONG_IN.get(maker, [])]


class TestArguments:
    @pytest.mark.parametrize(("maker", "name", "value", "message"), WRONG)
    def test_a_wrong_argument_is_refused_in_one_line(self, maker, name, value, message):
        with pytest.raises(InputError) as error:
            MAKERS[maker](**{name: value})
        assert str(error.value) == message

    @pytest.mark.parametrize("maker", MAKERS.values(), ids=MAKERS)
    def test_numbers_of_numpy_count_as_those_of_python(self, maker):
        numbers = {"time_limit": np.int32(50), "distances": np.arange(1, 4), "map_flip": np.float32(0.5)}
        env = maker(seed=np.int64(3), **numbers)
        spec = env.maze_task if maker is mazebench.load else env.unwrapped.task
        assert spec == mazebench.Task.of(time_limit=50, distances=(1, 2, 3), map_flip=0.5)

    @pytest.mark.parametrize("make", [Environment, MazeEnv, lambda spec: MazeVectorEnv(spec, 2)])
    def test_anything_but_a_task_is_refused(self, make):
        with pytest.raises(InputError, match=r"expected a Task, as mazebench.Task.of\(\) returns, found str"):
            make("local")


class TestReset:
    @pytest.mark.parametrize("seed", [-1, [1, 2]])
    @pytest.mark.parametrize("make", [Environment, lambda spec: MazeVectorEnv(spec, 3)])
    def test_a_wrong_seed_is_refused(self, make, seed):
        with pytest.raises(
            InputError, match=r"expected seed of (at least 0|type int \| None)|expected 3 seeds, found 2"
        ):
            make(SPEC).reset(seed=seed)

    def test_an_episode_that_ends_where_it_begins_is_refused(self):
        cell = SPEC.mazes[0].free_cells[0]
        episode = Episode(0, tuple(cell.tolist()), tuple(cell.tolist()), 0.0, 1)
        with pytest.raises(InputError, match="expected a goal in another cell than the start, found both in"):
            MazeEnv(SPEC).reset(options={"episode": episode})

    @pytest.mark.parametrize("options", [3, {"level": 2}, {"episode": 3}])
    def test_wrong_options_are_refused(self, options):
        with pytest.raises(InputError, match=r"options as a dict|unknown option 'level'|to be an Episode, found int"):
            MazeEnv(SPEC).reset(options=options)


class TestActions:
    @pytest.mark.parametrize("action", [6, -1, 1.5, None, [0, 0]])
    @pytest.mark.parametrize("make", [MazeEnv, Environment, lambda spec: MazeVectorEnv(spec, 3)])
    def test_a_wrong_action_is_refused_in_one_line_and_the_episode_goes_on(self, make, action):
        env = make(SPEC)
        env.reset(seed=0)
        with pytest.raises(
            InputError, match=r"^expected (an action|3 actions) from 0 to 5[^\n]*, (found|values)[^\n]*$"
        ):
            env.step(action)
        env.step(np.zeros(3, dtype=int) if isinstance(env, MazeVectorEnv) else 0)

    @pytest.mark.parametrize("action", [None, [0, 0], [np.nan, 0, 0], np.full((3, 3), np.inf)], ids=str)
    @pytest.mark.parametrize("make", [MazeEnv, Environment, lambda spec: MazeVectorEnv(spec, 3)])
    def test_a_wrong_velocity_is_refused_in_one_line(self, make, action):
        env = make(mazebench.Task.of(size=13, actions="velocity"))
        env.reset(seed=0)
        with pytest.raises(InputError, match=r"^expected velocities [^\n]*, found shape [^\n]*$"):
            env.step(action)
