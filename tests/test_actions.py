"""Continuous actions: velocities on the same actuators, the same in all three environments."""

from __future__ import annotations

import dm_env
import gymnasium
import numpy as np
import pytest
import simple_mazes
from dm_env import specs
from gymnasium.utils import env_checker

from mazebench.constants import ACTIONS, TOP_SPEED
from mazebench.envs.dm_control import Environment
from mazebench.envs.gym import MazeEnv
from mazebench.envs.vector import MazeVectorEnv
from mazebench.maps.benchmark import load_mazes
from mazebench.maps.maze import Maze, cell_to_point
from mazebench.tasks.episode import Episode
from mazebench.tasks.task import Task
from mazebench.world.mjcf import BODY_RADIUS, TURN_RATE, action_controls, velocity_controls

MIDDLE = Episode(0, (20, 20), (35, 35), 0.0, 0)
# The velocity that stands for each of the six actions.
UNIT_VELOCITIES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])


@pytest.fixture(scope="module")
def field() -> Environment:
    return Environment(Task.of(mazes=simple_mazes.field(41), distances=[30], actions="velocity"))


def cruise(field: Environment, velocity, num_steps: int = 12) -> np.ndarray:
    """Forward, left (m/s) and turn rate (rad/s) after driving for some time."""
    field.reset(episode=MIDDLE)
    for _ in range(num_steps):
        state = field.step(np.array(velocity)).observation["state"]
    return state[[6, 7, 11]]


class TestControls:
    def test_unit_velocities_are_the_six_actions(self):
        np.testing.assert_array_equal(velocity_controls(UNIT_VELOCITIES), action_controls())
        np.testing.assert_array_equal(velocity_controls(np.zeros(3)), np.zeros(5))

    @pytest.mark.parametrize("share", [1.0, 0.75, 0.5, 0.25, -0.5, -1.0])
    def test_a_body_cruises_at_its_share_of_the_top_speed(self, field, share):
        np.testing.assert_allclose(cruise(field, [share, 0, 0]), [share * TOP_SPEED, 0, 0], atol=1e-3)
        np.testing.assert_allclose(cruise(field, [0, share, 0]), [0, share * TOP_SPEED, 0], atol=1e-3)
        np.testing.assert_allclose(cruise(field, [0, 0, share]), [0, 0, share * TURN_RATE], atol=1e-3)

    def test_a_body_driving_aslant_is_no_faster(self, field):
        forward, left, _ = cruise(field, [1, 1, 0])
        assert (forward, left) == pytest.approx((TOP_SPEED / np.sqrt(2),) * 2, abs=1e-3)
        forward, left, _ = cruise(field, [-0.3, 0.4, 0])
        assert (forward, left) == pytest.approx((-0.3 * TOP_SPEED, 0.4 * TOP_SPEED), abs=1e-3)

    def test_no_velocity_drives_a_body_into_a_wall(self):
        spec = Task.of("local", size=13, actions="velocity")
        envs, rng = MazeVectorEnv(spec, 32, seed=0), np.random.default_rng(0)
        envs.reset(seed=0)
        depth = 0.0
        for step in range(120):
            if step % 6 == 0:
                actions = rng.uniform(-1, 1, size=(32, 3))
            _, _, _, _, info = envs.step(actions)
            depth = max(
                depth, *(sunk_in(spec.all_mazes[m], p) for m, p in zip(info["maze"], info["position"], strict=True))
            )
        assert depth < 0.01


def sunk_in(maze: Maze, position: np.ndarray) -> float:
    """Returns the depth in metres of a body in a wall; negative if it stands free."""
    centres = cell_to_point(np.argwhere(maze.walls), maze.size)
    gaps = np.maximum(np.abs(centres - position) - 0.5, 0)
    return BODY_RADIUS - float(np.hypot(*gaps.T).min())


class TestEnvironments:
    def test_all_environments_declare_continuous_actions(self, field):
        assert field.action_spec() == specs.BoundedArray((3,), np.float32, -1.0, 1.0, name="action")
        env = MazeEnv(Task.of(actions="velocity"))
        assert env.action_space == gymnasium.spaces.Box(-1.0, 1.0, (3,), np.float32)
        envs = MazeVectorEnv(Task.of(actions="velocity"), 2)
        assert envs.action_space.shape == (2, 3)

    @pytest.mark.parametrize("task", ["local", "hierarchical"])
    def test_unit_velocities_play_the_discrete_episode(self, task):
        discrete, continuous = (MazeEnv(Task.of(task, actions=kind)) for kind in ("six", "velocity"))
        discrete.reset(seed=5)
        continuous.reset(seed=5)
        for action in np.random.default_rng(0).integers(len(ACTIONS), size=60):
            expected, found = discrete.step(action), continuous.step(UNIT_VELOCITIES[action])
            np.testing.assert_array_equal(expected[0]["state"], found[0]["state"])
            assert expected[1:4] == found[1:4]

    def test_steps_are_the_same_in_all_environments(self):
        spec = Task.of(mazes=load_mazes(13, "train")[:2], actions="velocity", time_limit=30)
        actions = np.random.default_rng(0).uniform(-1, 1, size=(20, 2, 3)).astype(np.float32)
        envs = MazeVectorEnv(spec, 2)
        seen = [envs.reset(seed=[4, 9])[0]["state"]] + [envs.step(action)[0]["state"] for action in actions]
        for slot, seed in enumerate((4, 9)):
            env, dm = MazeEnv(spec), Environment(spec)
            states = [env.reset(seed=seed)[0]["state"]] + [env.step(action)[0]["state"] for action in actions[:, slot]]
            steps = [dm.reset(seed=seed)] + [dm.step(action) for action in actions[:, slot]]
            np.testing.assert_array_equal(states, [states[slot] for states in seen])
            np.testing.assert_array_equal(states, [step.observation["state"] for step in steps])
            assert steps[0].step_type is dm_env.StepType.FIRST

    @pytest.mark.filterwarnings("ignore::UserWarning")
    def test_continuous_environments_pass_the_checks(self):
        env_checker.check_env(MazeEnv(Task.of(actions="velocity")), skip_render_check=True)

    def test_velocities_are_clipped(self, field):
        np.testing.assert_array_equal(cruise(field, [2, 0, -7], 3), cruise(field, [1, 0, -1], 3))

    @pytest.mark.parametrize("action", [0, [0, 0], [0, 0, np.nan]])
    def test_an_invalid_velocity_is_refused(self, field, action):
        field.reset(episode=MIDDLE)
        with pytest.raises(ValueError, match=r"expected velocities .* from -1 to 1 of shape \(3,\)"):
            field.step(action)

    @pytest.mark.parametrize("actions", [[0, 1], np.full((2, 3), np.inf)])
    def test_invalid_velocities_of_a_vector_are_refused(self, actions):
        envs = MazeVectorEnv(Task.of(actions="velocity"), 2)
        envs.reset(seed=0)
        with pytest.raises(ValueError, match=r"expected velocities .* of shape \(2, 3\)"):
            envs.step(actions)
