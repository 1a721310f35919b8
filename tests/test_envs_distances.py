"""Goals that become farther: every environment draws its episodes at other distances when it is asked to."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from simple_mazes import field

import mazebench
from mazebench.errors import InputError

ID = "mazebench/Local-13-v1"
MAKERS = {
    "single": lambda: gymnasium.make(ID, distances=[1]),
    "goal": lambda: gymnasium.make("mazebench/LocalGoal-13-v1", distances=[1]),
    "vector": lambda: gymnasium.make_vec(ID, num_envs=2, distances=[1]),
    "sync": lambda: gymnasium.make_vec(ID, num_envs=2, vectorization_mode="sync", distances=[1]),
    "async": lambda: gymnasium.make_vec(ID, num_envs=2, vectorization_mode="async", distances=[1]),
}


def distances_of(env) -> set[int]:
    """The distances of some episodes."""
    return {int(each) for _ in range(12) for each in np.atleast_1d(env.reset()[1]["distance"])}


@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)
def test_they_stay_as_a_reset_sets_them_until_they_change(make):
    env = make()
    env.reset(seed=0)
    for distances, expected in ((np.array([3, 4]), {3, 4}), (range(2, 4), {2, 3}), (2, {2})):
        env.reset(options={"distances": distances})
        assert distances_of(env) == expected
    env.close()


@pytest.mark.parametrize("make", [gymnasium.make, gymnasium.make_vec])
def test_episodes_are_those_of_an_environment_that_was_made_with_them(make):
    env, other = make(ID, distances=[1]), make(ID, distances=range(2, 6))
    for reset in ({"seed": 7, "options": {"distances": range(2, 6)}}, {}):
        np.testing.assert_equal(env.reset(**reset), other.reset(seed=reset.get("seed")))
    assert env.unwrapped.task == other.unwrapped.task


@pytest.mark.parametrize("make", [gymnasium.make, gymnasium.make_vec])
@pytest.mark.parametrize(
    ("distances", "message"),
    [
        ([], "expected at least one distance, found none"),
        ([2, 99], "expected distances of at most .* as far as the maze reaches, found 99"),
        ("1-3", r"range\(1, 4\), found '1-3'"),
        (None, "expected distances of type"),
        (1.5, "expected distances of type"),
        (0, "expected distances of at least 1, found 0"),
    ],
)
def test_wrong_ones_are_refused_at_once_and_change_nothing(make, distances, message):
    env, other = make(ID, distances=[1], seed=0), make(ID, distances=[1], seed=0)
    with pytest.raises(InputError, match=message):
        env.unwrapped.draw_distances(distances)
    with pytest.raises(InputError, match=message):
        env.reset(seed=1, options={"distances": distances})
    np.testing.assert_equal(env.reset(), other.reset())


@pytest.mark.parametrize("options", [{"task": "hierarchical"}, {"start": "1,1", "goal": "1,2"}], ids=str)
def test_a_task_that_draws_no_goals_refuses_them(options):
    with pytest.raises(InputError, match="distances"):
        mazebench.make(mazes=field(7), **options).draw_distances([3])


def test_a_state_has_those_of_its_time():
    env = mazebench.load("local", size=13, seed=0, distances=[1])
    env.reset()
    state = env.get_state()
    expected = env.reset().observation
    env.task.draw_distances([5])
    assert env.maze_task.distances == (5,)
    env.set_state(state)
    np.testing.assert_equal(env.reset().observation, expected)


@pytest.mark.parametrize("make", ["single", "vector"])
def test_they_pass_through_the_vectors_of_stable_baselines(make):
    dummy = pytest.importorskip("stable_baselines3.common.vec_env").DummyVecEnv
    from mazebench_agents.integrations.sb3 import MazeVecEnv

    envs = dummy([MAKERS["single"]] * 2) if make == "single" else MazeVecEnv(MAKERS["vector"]())
    envs.set_options({"distances": [4]})
    for _ in range(2):
        envs.reset()
        assert [task.distances for task in envs.get_attr("task")] == [(4,)] * 2
    envs.env_method("draw_distances", [5])
    assert [task.distances for task in envs.get_attr("task")] == [(5,)] * 2
