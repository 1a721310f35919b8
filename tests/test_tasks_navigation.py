"""The dm_control environment, driven by hand along a corridor."""

from __future__ import annotations

import itertools

import dm_env
import numpy as np
import pytest
from absl.testing import absltest
from dm_env import test_utils
from processes import run_with_egl
from simple_mazes import field

import mazebench
from mazebench.envs.dm_control import Environment
from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze
from mazebench.tasks.episode import Episode
from mazebench.world.mjcf import TURN_RATE

FORWARD, BACKWARD, STRAFE_LEFT, STRAFE_RIGHT, LOOK_LEFT, LOOK_RIGHT = range(6)
EAST, NORTH, WEST = 0.0, np.pi / 2, np.pi
SIZE, ROW, Y = 9, 4, 4.5  # the corridor is the row 4, with y = 9 - 4 - 0.5
STEPS_TO_GOAL = 6  # from rest at (4, 1) to the cell (4, 4), 2.5 m on: 1 m in 24 frames, 1.5 m at 3.2 m/s


def corridor() -> Maze:
    """7 free cells, from (4, 1) to (4, 7)."""
    walls = np.ones((SIZE, SIZE), dtype=bool)
    walls[ROW, 1:8] = False
    return Maze(walls, "corridor")


def dfs_mazes(count: int = 3) -> list[Maze]:
    rng = np.random.default_rng(0)
    return [generate("dfs", SIZE, rng) for _ in range(count)]


def eastwards(start: int = 1, goal: int = 4, yaw: float = EAST) -> Episode:
    return Episode(0, (ROW, start), (ROW, goal), yaw, seed=0)


def play(env: Environment, actions, **reset) -> list[dm_env.TimeStep]:
    """Resets, then steps until the actions or the episode end."""
    time_steps = [env.reset(**reset)]
    for action in actions:
        if time_steps[-1].last():
            break
        time_steps.append(env.step(action))
    return time_steps


def assert_equal(first: list[dm_env.TimeStep], second: list[dm_env.TimeStep]) -> None:
    for one, other in zip(first, second, strict=True):
        assert (one.step_type, one.reward, one.discount) == (other.step_type, other.reward, other.discount)
        assert one.observation.keys() == other.observation.keys()
        for key in one.observation:
            np.testing.assert_array_equal(one.observation[key], other.observation[key], err_msg=key)


def contexts(time_steps: list[dm_env.TimeStep]) -> list[np.ndarray]:
    return [time_step.observation["context"] for time_step in time_steps]


class LocalContractTest(test_utils.EnvironmentTestMixin, absltest.TestCase):
    def make_object_under_test(self):
        return mazebench.load("local", mazes=dfs_mazes(), time_limit=8, seed=0)


class HierarchicalContractTest(test_utils.EnvironmentTestMixin, absltest.TestCase):
    def make_object_under_test(self):
        return mazebench.load("hierarchical", mazes=corridor(), time_limit=4, seed=0)


class PerturbedContractTest(test_utils.EnvironmentTestMixin, absltest.TestCase):
    def make_object_under_test(self):
        noise = {"map_flip": 0.1, "map_warp": 0.1, "position_noise": 0.3}
        return mazebench.load("hierarchical", mazes=dfs_mazes(), time_limit=4, context_size=7, seed=0, **noise)


class TestRewardsAndEndings:
    def test_an_episode_ends_with_reward_0_when_the_goal_is_reached(self):
        env = mazebench.load(mazes=corridor())
        time_steps = play(env, [FORWARD] * 20, episode=eastwards())
        assert time_steps[0].step_type is dm_env.StepType.FIRST
        assert (time_steps[0].reward, time_steps[0].discount) == (None, None)
        assert len(time_steps) == 1 + STEPS_TO_GOAL
        for time_step in time_steps[1:-1]:
            assert (time_step.step_type, time_step.reward, time_step.discount) == (dm_env.StepType.MID, -1.0, 1.0)
            assert time_step.observation["state"][0] < 4
        last = time_steps[-1]
        assert (last.step_type, last.reward, last.discount) == (dm_env.StepType.LAST, 0.0, 0.0)
        assert 4 <= last.observation["state"][0] < 5
        assert env.task.success
        assert env.task.steps == STEPS_TO_GOAL

    def test_an_episode_is_cut_short_when_time_is_out(self):
        env = mazebench.load(mazes=corridor(), time_limit=STEPS_TO_GOAL - 1)
        time_steps = play(env, [FORWARD] * 20, episode=eastwards())
        assert len(time_steps) == STEPS_TO_GOAL
        last = time_steps[-1]
        assert (last.step_type, last.reward, last.discount) == (dm_env.StepType.LAST, -1.0, 1.0)
        assert not env.task.success

    def test_a_goal_reached_on_the_last_step_counts(self):
        env = mazebench.load(mazes=corridor(), time_limit=STEPS_TO_GOAL)
        last = play(env, [FORWARD] * 20, episode=eastwards())[-1]
        assert (last.step_type, last.reward, last.discount) == (dm_env.StepType.LAST, 0.0, 0.0)

    def test_a_step_after_the_end_begins_a_new_episode(self):
        env = mazebench.load(mazes=corridor(), time_limit=1)
        play(env, [FORWARD], episode=eastwards())
        assert env.needs_reset
        assert env.step(FORWARD).first()
        assert not env.needs_reset

    def test_the_path_length_is_that_of_the_whole_way(self):
        env = mazebench.load(mazes=field(SIZE))
        env.reset(episode=Episode(0, (4, 2), (1, 1), EAST, 0))
        driven = 0.0
        for action in [FORWARD] * 4 + [BACKWARD] * 6:
            before = env.physics.position()
            env.step(action)
            driven += np.hypot(*(env.physics.position() - before))
        assert env.task.path_length == pytest.approx(driven, abs=1e-12)
        assert driven > np.hypot(*(env.physics.position() - (2.5, 4.5))) + 0.5


class TestState:
    def test_an_episode_begins_at_rest_in_the_middle_of_its_start(self):
        # The centre of (4, 3) of 9 x 9 is (3.5, 4.5).
        state = play(mazebench.load(mazes=field(SIZE)), [], episode=eastwards(start=3, yaw=0.5))[0].observation["state"]
        assert state.dtype == np.float32
        np.testing.assert_allclose(state, [3.5, Y, 0.28, 0, 0, 0.5] + [0] * 6, atol=1e-6)

    @pytest.mark.parametrize(
        ("action", "forward", "left"),
        [(FORWARD, 1, 0), (BACKWARD, -1, 0), (STRAFE_LEFT, 0, 1), (STRAFE_RIGHT, 0, -1)],
    )
    @pytest.mark.parametrize("yaw", [NORTH, 2.0])
    def test_velocities_are_given_in_the_bodys_frame(self, action, forward, left, yaw):
        env = mazebench.load(mazes=field(SIZE))
        state = play(env, [action], episode=Episode(0, (4, 4), (1, 1), yaw, 0))[-1].observation["state"]
        speed = 3.0  # m/s after 10 frames
        np.testing.assert_allclose(state[6:9], [forward * speed, left * speed, 0], atol=0.05)
        np.testing.assert_allclose(state[9:], 0, atol=1e-6)
        moved = state[:2] - (4.5, Y)
        bearing = yaw + np.arctan2(left, forward)
        np.testing.assert_allclose(moved, np.hypot(*moved) * np.array([np.cos(bearing), np.sin(bearing)]), atol=1e-3)
        assert state[5] == pytest.approx(yaw, abs=1e-6)

    @pytest.mark.parametrize(("action", "sign"), [(LOOK_LEFT, 1), (LOOK_RIGHT, -1)])
    def test_a_body_turns_on_the_spot(self, action, sign):
        env = mazebench.load(mazes=field(SIZE))
        state = play(env, [action], episode=Episode(0, (4, 4), (1, 1), 0.0, 0))[-1].observation["state"]
        np.testing.assert_allclose(state[9:], [0, 0, sign * TURN_RATE], atol=1e-3)
        assert state[5] == pytest.approx(sign * np.deg2rad(21.12), rel=0.01)
        np.testing.assert_allclose(state[6:9], 0, atol=1e-6)


class TestContext:
    def test_the_context_shows_the_walls_the_goal_and_the_start(self):
        context = contexts(play(mazebench.load(mazes=corridor()), [], episode=eastwards()))[0]
        assert context.shape == (4, SIZE, SIZE)
        assert context.dtype == np.float32
        np.testing.assert_array_equal(context[0], corridor().walls)
        np.testing.assert_array_equal(np.argwhere(context[2]), [[ROW, 4]])
        np.testing.assert_array_equal(np.argwhere(context[3]), [[ROW, 1]])

    def test_an_agent_may_write_to_its_observation(self):
        env = mazebench.load(mazes=corridor())
        first = env.reset(episode=eastwards())
        kept = {key: value.copy() for key, value in first.observation.items()}
        first.observation["context"][:] = 9
        first.observation["state"][:] = 9
        second = env.step(LOOK_LEFT)
        np.testing.assert_array_equal(second.observation["context"], kept["context"])
        np.testing.assert_allclose(second.observation["state"][:2], kept["state"][:2], atol=1e-6)


class TestPositionNoise:
    def test_noise_changes_the_observed_position_only(self):
        episode = Episode(0, (4, 4), (1, 1), 0.3, seed=11)
        clean, noisy = (mazebench.load(mazes=field(SIZE), position_noise=scale) for scale in (0.0, 0.5))
        actions = np.random.default_rng(0).integers(6, size=90)
        clean_states, noisy_states = (self.states(env, actions, episode) for env in (clean, noisy))
        np.testing.assert_array_equal(noisy_states[:, 2:], clean_states[:, 2:])
        noise = noisy_states[:, :2] - clean_states[:, :2]
        assert np.all(noise != 0)
        assert noise.std() == pytest.approx(0.5, rel=0.2)
        assert abs(noise.mean()) < 0.15
        np.testing.assert_array_equal(noisy.physics.position(), clean.physics.position())
        assert noisy.task.path_length == clean.task.path_length

    def test_the_true_position_decides_whether_the_goal_is_reached(self):
        # Reward and end speak of the true position.
        env = mazebench.load(mazes=corridor(), position_noise=3.0)
        time_steps = play(env, [FORWARD] * 20, episode=eastwards())
        assert len(time_steps) == 1 + STEPS_TO_GOAL
        assert time_steps[-1].discount == 0.0

    def states(self, env: Environment, actions, episode: Episode) -> np.ndarray:
        return np.array([time_step.observation["state"] for time_step in play(env, actions, episode=episode)])


class TestHierarchical:
    def test_a_landmark_that_is_not_reached_in_time_is_given_up(self):
        # From (4, 7) to (4, 1), 6 cells: landmarks at columns 5 and 3, then the goal at 1.
        env = mazebench.load("hierarchical", mazes=corridor(), landmark_distance=2, time_limit=3)
        time_steps = play(env, [LOOK_LEFT] * 20, seed=0)
        assert len(time_steps) == 1 + 9
        assert self.first_steps(time_steps) == [0, 3, 6]
        assert self.marked_columns(time_steps, plane=3) == [7, 7, 7, 5, 5, 5, 3, 3, 3, 3]
        assert self.marked_columns(time_steps, plane=2) == [5, 5, 5, 3, 3, 3, 1, 1, 1, 1]
        assert all(time_step.mid() and time_step.discount == 1.0 for time_step in time_steps[1:-1])
        assert all(time_step.reward == -1.0 for time_step in time_steps[1:])
        assert time_steps[-1].last()
        assert time_steps[-1].discount == 1.0

    def test_the_next_landmark_comes_when_one_is_reached(self):
        env = mazebench.load("hierarchical", mazes=corridor(), landmark_distance=2)
        time_steps = play(env, [FORWARD] * 50, episode=eastwards(start=7, goal=1, yaw=WEST))
        columns = [int(time_step.observation["state"][0]) for time_step in time_steps]
        first_in = [columns.index(column) for column in (7, 5, 3)]
        assert self.first_steps(time_steps) == first_in
        last = time_steps[-1]
        assert (last.reward, last.discount, columns[-1]) == (0.0, 0.0, 1)
        assert all(time_step.reward == -1.0 for time_step in time_steps[1:-1])
        assert env.task.success

    def test_the_local_map_is_centred_on_the_legs_start(self):
        env = mazebench.load("hierarchical", mazes=corridor(), landmark_distance=2, time_limit=3)
        for time_step in play(env, [LOOK_LEFT] * 20, seed=0):
            column = int(np.argwhere(time_step.observation["context"][3])[0, 1])
            local_map = time_step.observation["context"][1]
            # The start stands at (4, 4): the corridor's ends, columns 1 and 7, are as far from there as from it.
            free = [index for index in range(SIZE) if 1 <= column + index - 4 <= 7]
            np.testing.assert_array_equal(np.flatnonzero(local_map[4] == 0), free)
            assert local_map[[0, 1, 2, 3, 5, 6, 7, 8]].all()

    def test_the_context_changes_only_where_is_first_says_so(self):
        env = mazebench.load("hierarchical", mazes=dfs_mazes(), landmark_distance=1, time_limit=7, seed=0)
        rng = np.random.default_rng(1)
        time_steps = play(env, rng.integers(6, size=100))
        switches = 0
        for before, after in itertools.pairwise(time_steps):
            changed = not np.array_equal(*contexts([before, after]))
            assert changed == bool(after.observation["is_first"])
            switches += changed
        assert switches > 5

    def test_a_goal_entered_before_the_landmarks_ends_the_episode(self):
        # The landmarks lie along two sides of the room, the body drives along its diagonal.
        env = mazebench.load("hierarchical", mazes=field(SIZE), landmark_distance=5)
        time_steps = play(env, [FORWARD] * 50, episode=Episode(0, (1, 7), (7, 1), -3 * np.pi / 4, 0))
        assert env.task.route.cells == [(1, 7), (1, 2), (5, 1), (7, 1)]
        assert env.task.route.leg == 0
        assert self.first_steps(time_steps) == [0]
        assert (time_steps[-1].reward, time_steps[-1].discount) == (0.0, 0.0)

    def first_steps(self, time_steps: list[dm_env.TimeStep]) -> list[int]:
        return [index for index, time_step in enumerate(time_steps) if time_step.observation["is_first"]]

    def marked_columns(self, time_steps: list[dm_env.TimeStep], plane: int) -> list[int]:
        marked = [np.argwhere(context[plane]) for context in contexts(time_steps)]
        assert all(cells.shape == (1, 2) and cells[0, 0] == ROW for cells in marked)
        return [int(cells[0, 1]) for cells in marked]


class TestSeeds:
    OPTIONS = pytest.mark.parametrize(
        "options",
        [
            {"task": "hierarchical", "landmark_distance": 1, "time_limit": 5},
            {"task": "local", "map_flip": 0.3, "map_warp": 0.1, "position_noise": 0.2},
        ],
        ids=["hierarchical", "perturbed"],
    )
    ACTIONS = tuple(int(action) for action in np.random.default_rng(5).integers(6, size=20))

    @OPTIONS
    def test_the_same_seed_gives_the_same_episode(self, options):
        env = mazebench.load(mazes=dfs_mazes(), seed=0, **options)
        first = play(env, self.ACTIONS, seed=4)
        play(env, [FORWARD] * 7)  # breaks off in the middle
        play(env, [STRAFE_LEFT] * 200)
        assert_equal(first, play(env, self.ACTIONS, seed=4))

    @OPTIONS
    def test_later_episodes_follow_from_the_seed_and_are_others(self, options):
        # The next episodes follow from the seed too, and are others.
        first, second = (mazebench.load(mazes=dfs_mazes(), seed=4, **options) for _ in range(2))
        episodes = []
        for _ in range(3):
            assert_equal(play(first, self.ACTIONS), play(second, self.ACTIONS))
            episodes.append(first.task.episode)
        assert len({episode.seed for episode in episodes}) == 3


class TestPhysics:
    def test_the_goals_marker_stands_in_the_goal(self):
        env = mazebench.load(mazes=corridor())
        env.reset(episode=eastwards(goal=6))
        np.testing.assert_allclose(env.physics.named.data.xpos["goal"], (6.5, Y, 0))

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
