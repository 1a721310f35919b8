"""The dm_control environment: the contract of dm_env, its time steps, its physics and its seeds."""

from __future__ import annotations

import dm_env
import numpy as np
import pytest
from absl.testing import absltest
from dm_control.suite.wrappers import action_noise
from dm_env import test_utils
from processes import run_with_egl
from simple_mazes import corridor, field

import mazebench
from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze
from mazebench.tasks.episode import Episode

FORWARD, BACKWARD, STRAFE_LEFT, STRAFE_RIGHT, LOOK_LEFT, LOOK_RIGHT = range(6)
SIZE = 9
EASTWARDS = Episode(0, (1, 1), (1, 4), 0.0, seed=0)
STEPS_TO_GOAL = 6  # from rest at (1, 1) to the cell (1, 4), 2.5 m on: 1 m in 24 frames, 1.5 m at 3.2 m/s


def dfs_mazes(count: int = 3) -> list[Maze]:
    rng = np.random.default_rng(0)
    return [generate("dfs", SIZE, rng) for _ in range(count)]


def play(env, actions, **reset) -> list[dm_env.TimeStep]:
    """Resets, then steps until the actions or the episode end."""
    time_steps = [env.reset(**reset)]
    for action in actions:
        if time_steps[-1].last():
            break
        time_steps.append(env.step(action))
    return time_steps


class LocalContractTest(test_utils.EnvironmentTestMixin, absltest.TestCase):
    def make_object_under_test(self):
        return mazebench.load("local", mazes=dfs_mazes(), time_limit=8, seed=0)


class PerturbedContractTest(test_utils.EnvironmentTestMixin, absltest.TestCase):
    def make_object_under_test(self):
        noise = {"map_flip": 0.1, "map_warp": 0.1, "position_noise": 0.3}
        return mazebench.load("hierarchical", mazes=dfs_mazes(), time_limit=4, context_size=7, seed=0, **noise)


class TestTimeSteps:
    @pytest.mark.parametrize(
        ("time_limit", "steps", "last"),
        [(5, 5, (-1.0, 1.0)), (6, STEPS_TO_GOAL, (0.0, 0.0)), (100, STEPS_TO_GOAL, (0.0, 0.0))],
    )
    def test_an_episode_ends_at_the_goal_or_when_time_is_out(self, time_limit, steps, last):
        env = mazebench.load(mazes=corridor(), time_limit=time_limit)
        first, *middle, end = play(env, [FORWARD] * 20, episode=EASTWARDS)
        assert (first.step_type, first.reward, first.discount) == (dm_env.StepType.FIRST, None, None)
        assert {(step.step_type, step.reward, step.discount) for step in middle} == {(dm_env.StepType.MID, -1.0, 1.0)}
        assert (end.step_type, end.reward, end.discount) == (dm_env.StepType.LAST, *last)
        assert (env.task.steps, env.task.success) == (steps, last[0] == 0)
        assert env.needs_reset
        assert env.step(FORWARD).first()
        assert not env.needs_reset

    def test_the_context_changes_only_where_is_first_says_so(self):
        env = mazebench.load("hierarchical", mazes=dfs_mazes(), landmark_distance=1, time_limit=7, seed=0)
        before, *steps = (step.observation for step in play(env, np.random.default_rng(1).integers(6, size=100)))
        switches = 0
        for after in steps:
            assert np.array_equal(before["context"], after["context"]) != after["is_first"]
            switches += after["is_first"]
            before = after
        assert switches > 5

    def test_an_agent_may_write_to_its_observation(self):
        env = mazebench.load(mazes=corridor())
        first = env.reset(episode=EASTWARDS)
        kept = {key: value.copy() for key, value in first.observation.items()}
        first.observation["context"][:] = 9
        first.observation["state"][:] = 9
        second = env.step(LOOK_LEFT)
        np.testing.assert_array_equal(second.observation["context"], kept["context"])
        np.testing.assert_allclose(second.observation["state"][:2], kept["state"][:2], atol=1e-6)


class TestState:
    def test_an_episode_begins_at_rest_in_the_middle_of_its_start(self):
        # The centre of (4, 3) of 9 x 9 is (3.5, 4.5).
        env = mazebench.load(mazes=field(SIZE))
        state = env.reset(episode=Episode(0, (4, 3), (4, 4), 0.5, 0)).observation["state"]
        assert state.dtype == np.float32
        np.testing.assert_allclose(state, [3.5, 4.5, 0.28, 0, 0, 0.5] + [0] * 6, atol=1e-6)

    @pytest.mark.parametrize(
        ("action", "forward", "left"),
        [(FORWARD, 1, 0), (BACKWARD, -1, 0), (STRAFE_LEFT, 0, 1), (STRAFE_RIGHT, 0, -1)],
    )
    @pytest.mark.parametrize("yaw", [np.pi / 2, 2.0])
    def test_velocities_are_given_in_the_bodys_frame(self, action, forward, left, yaw):
        env = mazebench.load(mazes=field(SIZE))
        state = play(env, [action], episode=Episode(0, (4, 4), (1, 1), yaw, 0))[-1].observation["state"]
        speed = 3.0  # m/s after 10 frames
        np.testing.assert_allclose(state[6:9], [forward * speed, left * speed, 0], atol=0.05)
        np.testing.assert_allclose(state[9:], 0, atol=1e-6)
        moved = state[:2] - (4.5, 4.5)
        bearing = yaw + np.arctan2(left, forward)
        np.testing.assert_allclose(moved, np.hypot(*moved) * np.array([np.cos(bearing), np.sin(bearing)]), atol=1e-3)
        assert state[5] == pytest.approx(yaw, abs=1e-6)


class TestRandom:
    """`task.random` is what dm_control's suite offers and others set."""

    def test_the_wrapper_of_the_suite_draws_noise_that_follows_the_seed(self):
        env = mazebench.load(mazes=dfs_mazes(), seed=4, actions="velocity")
        noisy, still = action_noise.Wrapper(env, scale=0.3), [np.zeros(3, dtype=np.float32)] * 10
        first, following = play(noisy, still), noisy.reset()
        assert not np.array_equal(first[-1].observation["state"], first[0].observation["state"])
        np.testing.assert_equal([env.reset(seed=4), env.reset()], [first[0], following])  # no episode draws from it
        env.reset(seed=4)
        np.testing.assert_equal(first[1:], [noisy.step(action) for action in still])

    def test_a_generator_that_is_set_begins_a_stream_of_episodes(self):
        env, other = (mazebench.load(mazes=dfs_mazes(), seed=seed) for seed in range(2))
        streams = []
        for each in (env, env, other):
            each.task._random = np.random.RandomState(seed=3)  # as Shimmy's reset(seed=3)
            streams.append([each.reset() for _ in range(3)])
        for stream in streams[1:]:
            np.testing.assert_equal(streams[0], stream)


class TestPhysics:
    def test_the_goals_marker_stands_in_the_goal(self):
        env = mazebench.load(mazes=corridor())
        env.reset(episode=EASTWARDS)
        np.testing.assert_allclose(env.physics.named.data.xpos["goal"], (4.5, 7.5, 0))

    def test_each_camera_renders_the_episode(self):
        run_with_egl("""
env = mazebench.load(size=13, seed=0)
pictures = []
for _ in range(2):
    env.reset()
    pictures += [env.physics.render(64, 96, camera_id=camera) for camera in ("top", "egocentric")]
assert all(picture.shape == (64, 96, 3) and picture.dtype == np.uint8 for picture in pictures)
assert all(picture.std() > 5 for picture in pictures)
assert not np.array_equal(pictures[0], pictures[2])
""")
