"""The goal-conditioned environment: the goal stands in one place, and what is computed from goals is what happened."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from gymnasium.utils import env_checker
from simple_mazes import corridor

from mazebench.envs.goal import GoalMazeEnv
from mazebench.envs.gym import MazeEnv
from mazebench.errors import InputError
from mazebench.tasks.episode import Episode
from mazebench.tasks.task import Task

FORWARD, LOOK_LEFT = 0, 4


def corridor_spec(**options):
    return Task.of(mazes=corridor(), **options)


def drive(env: GoalMazeEnv, episode: Episode, num_steps: int, action: int = FORWARD):
    """All that reset and the steps return, and the reset's with no reward and no ends."""
    observation, info = env.reset(options={"episode": episode})
    steps = [(observation, None, False, False, info)]
    for _ in range(num_steps):
        steps.append(env.step(action))
        if steps[-1][2] or steps[-1][3]:
            break
    return steps


class TestObservation:
    def test_the_observation_is_the_tasks_without_the_goal(self):
        goal_env, env = GoalMazeEnv(Task.of()), MazeEnv(Task.of())
        found, expected = goal_env.reset(seed=7)[0], env.reset(seed=7)[0]
        for _ in range(5):
            assert goal_env.observation_space.contains(found)
            planes = found["observation"][12:].reshape(3, 13, 13)
            np.testing.assert_array_equal(found["observation"][:12], expected["state"])
            np.testing.assert_array_equal(planes, expected["context"][[0, 1, 3]])
            found, expected = goal_env.step(FORWARD)[0], env.step(FORWARD)[0]

    def test_the_goal_stands_in_desired_goal_only(self):
        env = GoalMazeEnv(corridor_spec())
        near, far = (env.reset(options={"episode": Episode(0, (1, 3), (1, c), 0.0, 0)})[0] for c in (4, 7))
        assert [key for key in near if not np.array_equal(near[key], far[key])] == ["desired_goal"]

    def test_pictures_do_not_show_the_goal(self):
        spec, episode = corridor_spec(sensors=("egocentric", "depth", "labels")), Episode(0, (1, 1), (1, 3), 0.0, 0)
        (found, _), (shown, _) = (env(spec).reset(options={"episode": episode}) for env in (GoalMazeEnv, MazeEnv))
        assert (set(np.unique(found["labels"])), set(np.unique(shown["labels"]))) == ({0, 1, 2}, {0, 1, 2, 3})
        is_disc = shown["labels"] == 3
        for name in ("egocentric", "depth"):
            assert (found[name] == shown[name])[~is_disc].all()
            assert (found[name] != shown[name])[is_disc].any()

    def test_pictures_do_not_show_it_after_a_return_to_a_state_of_another_environment(self):
        spec = corridor_spec(sensors="labels")
        goal_env, env = GoalMazeEnv(spec), MazeEnv(spec)
        for each in (goal_env, env):
            each.reset(options={"episode": Episode(0, (1, 1), (1, 3), 0.0, 0)})
        goal_env.set_state(env.get_state())
        assert (goal_env.step(LOOK_LEFT)[0]["labels"] != 3).all()

    def test_goals_are_centres_of_cells(self):
        # The centre of cell (1, c) of 9 x 9 is (c + 0.5, 7.5).
        steps = drive(GoalMazeEnv(corridor_spec()), Episode(0, (1, 1), (1, 4), 0.0, 0), 6)
        np.testing.assert_array_equal([step[0]["desired_goal"] for step in steps], [[4.5, 7.5]] * 7)
        columns = [1, 1, 2, 2, 3, 3, 4]
        np.testing.assert_array_equal([step[0]["achieved_goal"] for step in steps], [[c + 0.5, 7.5] for c in columns])

    def test_the_achieved_goal_is_the_true_place(self):
        env = GoalMazeEnv(corridor_spec(position_noise=5.0))
        np.testing.assert_array_equal(
            env.reset(options={"episode": Episode(0, (1, 1), (1, 4), 0.0, 0)})[0]["achieved_goal"], [1.5, 7.5]
        )


class TestComputed:
    @pytest.mark.parametrize(("time_limit", "action"), [(100, FORWARD), (6, FORWARD), (5, FORWARD), (4, LOOK_LEFT)])
    def test_computed_outcomes_are_those_of_the_step(self, time_limit, action):
        env = GoalMazeEnv(corridor_spec(time_limit=time_limit))
        for observation, reward, terminated, truncated, info in drive(
            env, Episode(0, (1, 1), (1, 4), 0.0, 0), 10, action
        )[1:]:
            goals = (observation["achieved_goal"], observation["desired_goal"], info)
            assert env.compute_reward(*goals) == reward
            assert env.compute_terminated(*goals) == terminated
            assert env.compute_truncated(*goals) == truncated

    def test_outcomes_of_arrays_are_computed(self):
        env = GoalMazeEnv(corridor_spec(time_limit=9))
        achieved = np.array([[1.5, 7.5], [2.5, 7.5], [2.5, 7.5], [2.5, 6.5]], dtype=np.float32)
        desired = np.array([[1.5, 7.5], [2.5, 7.5], [1.5, 7.5], [2.5, 7.5]], dtype=np.float32)
        infos = [{"steps": steps} for steps in (8, 9, 9, 8)]
        np.testing.assert_array_equal(env.compute_reward(achieved, desired, infos), [0, 0, -1, -1])
        np.testing.assert_array_equal(env.compute_reward(achieved, desired, [{}] * 4), [0, 0, -1, -1])
        np.testing.assert_array_equal(env.compute_terminated(achieved, desired, infos), [True, True, False, False])
        np.testing.assert_array_equal(env.compute_truncated(achieved, desired, infos), [False, False, True, False])

    def test_a_relabelled_episode_is_the_episode_to_that_goal(self):
        # What hindsight makes of an episode that missed its goal is the episode to the goal that it reached.
        env = GoalMazeEnv(corridor_spec(time_limit=7))
        missed = drive(env, Episode(0, (1, 1), (1, 7), 0.0, 0), 4)
        there = drive(env, Episode(0, (1, 1), (1, 3), 0.0, 0), 4)
        assert there[-1][2]
        new_goal = missed[-1][0]["achieved_goal"]
        for old, new in zip(missed[1:], there[1:], strict=True):
            for key in ("observation", "achieved_goal"):
                np.testing.assert_array_equal(old[0][key], new[0][key])
            assert env.compute_reward(old[0]["achieved_goal"], new_goal, old[4]) == new[1]
            assert env.compute_terminated(old[0]["achieved_goal"], new_goal, old[4]) == new[2]


class TestEnvironment:
    @pytest.mark.filterwarnings("ignore::UserWarning")
    def test_the_environment_passes_the_checks(self):
        env = gymnasium.make("mazebench/LocalGoal-13-v1", seed=1)
        env_checker.check_env(env.unwrapped, skip_render_check=True)
        pytest.importorskip("stable_baselines3.common.env_checker").check_env(env.unwrapped)

    @pytest.mark.parametrize("options", [{"task": "hierarchical"}, {"num_goals": 2}])
    def test_a_task_with_several_goals_is_refused(self, options):
        with pytest.raises(InputError, match="expected the local task, one goal, no track, no hide"):
            GoalMazeEnv(Task.of(**options))

    def test_progress_which_another_goal_does_not_have_is_refused(self):
        with pytest.raises(InputError, match="expected reward 'sparse', found 'progress'"):
            GoalMazeEnv(Task.of(reward="progress"))
