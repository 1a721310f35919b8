"""Odometry as the observed pose."""

from __future__ import annotations

import math

import numpy as np
import pytest

import mazebench
from mazebench.constants import STEP_TIME
from mazebench.envs.goal import GoalMazeEnv
from mazebench.errors import InputError
from mazebench.tasks.perturbations.odometry import LostPose, Odometry
from mazebench.tasks.task import Task
from mazebench.world.bodies import SLIDER

X, Y, YAW, FORWARD, LEFT, YAW_RATE = 0, 1, 5, 6, 7, 11  # indices in the state


def state_at(x: float, y: float, yaw: float, forward: float = 0.0, left: float = 0.0) -> np.ndarray:
    return np.array([x, y, 0.28, 0, 0, yaw, forward, left, 0, 0, 0, 0], dtype=float)


def observed(odometry: Odometry, states: np.ndarray) -> np.ndarray:
    """`[T, 12]`: what odometry makes of true states in turn."""
    states = states.copy()
    for state in states:
        odometry(state)
    return states


def exact(scale: float = 1.0) -> Odometry:
    return Odometry(np.random.default_rng(0), scale)


def driven(seed: int, num_steps: int = 100) -> np.ndarray:
    """`[T, 12]` true states of a body that drives and turns at random in a maze, and often meets its walls."""
    env = mazebench.load(size=13, time_limit=num_steps + 1, distances=(15,), seed=seed)
    env.reset()
    rng = np.random.default_rng(seed)
    states = [SLIDER.state(env.physics.data.sensordata)]
    action = 0
    while len(states) <= num_steps:
        if rng.random() < 0.5:
            action = int(rng.choice(6, p=[0.4, 0.1, 0.1, 0.1, 0.15, 0.15]))
        env.step(action)
        states.append(SLIDER.state(env.physics.data.sensordata))
    return np.array(states)


@pytest.fixture(scope="module")
def drives() -> list[np.ndarray]:
    return [driven(seed) for seed in range(3)]


def relative_poses(states: np.ndarray) -> np.ndarray:
    """`[T, 3]`: true poses (x, y, yaw) as seen from the first one, whose x axis lies along the heading."""
    yaw = states[0, YAW]
    x, y = (states[:, :2] - states[0, :2]).T
    turned = np.stack([np.cos(yaw) * x + np.sin(yaw) * y, np.cos(yaw) * y - np.sin(yaw) * x], axis=-1)
    return np.column_stack([turned, wrap(states[:, YAW] - yaw)])


def wrap(angle: np.ndarray) -> np.ndarray:
    return (angle + np.pi) % (2 * np.pi) - np.pi


class TestExactOdometry:
    def test_the_first_axis_lies_along_the_initial_heading(self):
        # Northwards from (3.5, 4.5), 2 m ahead and then 1 m to the left, which is west.
        states = np.array([state_at(3.5, 4.5, math.pi / 2), state_at(3.5, 6.5, math.pi / 2), state_at(2.5, 6.5, 2.0)])
        poses = observed(exact(), states)[:, [X, Y, YAW]]
        np.testing.assert_allclose(poses, [[0, 0, 0], [2, 0, 0], [2, 1, 2.0 - math.pi / 2]], atol=1e-12)

    def test_the_pose_is_the_true_one_as_seen_from_the_first(self, drives):
        for states in drives:
            poses = observed(exact(), states)[:, [X, Y, YAW]]
            np.testing.assert_allclose(poses[:, :2], relative_poses(states)[:, :2], atol=1e-10)
            np.testing.assert_allclose(wrap(poses[:, 2] - relative_poses(states)[:, 2]), 0, atol=1e-10)

    def test_the_yaw_is_wrapped(self):
        states = np.array([state_at(1.5, 1.5, wrap(turn * 0.36)) for turn in range(40)])
        yaws = observed(exact(), states)[:, YAW]
        assert yaws.min() >= -math.pi
        assert yaws.max() < math.pi
        np.testing.assert_allclose(np.diff(np.unwrap(yaws)), 0.36)


def corrupted_odometry(seed: int) -> Odometry:
    return LostPose(drifts=True).observed(np.random.default_rng(seed))


class TestCorruptedOdometry:
    def test_the_scale_is_that_of_translation_and_linear_velocity(self):
        states = np.array([state_at(3.5, 4.5, 0.0, 1.0, 2.0), state_at(5.5, 5.5, 0.0, 3.0, -1.0)])
        values = observed(exact(scale=1.1), states)[:, [X, Y, YAW, FORWARD, LEFT]]
        np.testing.assert_allclose(values, [[0, 0, 0, 1.1, 2.2], [2.2, 1.1, 0, 3.3, -1.1]], atol=1e-12)

    def test_the_scale_of_an_episode_is_uniform(self):
        scales = np.array([corrupted_odometry(seed).scale for seed in range(2000)])
        assert scales.min() >= 0.9
        assert scales.max() <= 1.1
        # Of 2000 draws, with a standard deviation of 0.2 / sqrt(12).
        assert abs(scales.mean() - 1) < 4 * 0.0577 / np.sqrt(2000)
        assert scales.std() == pytest.approx(0.0577, rel=0.05)

    def test_the_heading_walks_by_2_degrees_per_root_second(self):
        still = np.tile(state_at(3.5, 4.5, 1.0), (101, 1))  # 16 s
        yaws = np.array([observed(corrupted_odometry(i), still)[-1, YAW] for i in range(1000)])
        assert abs(yaws.mean()) < 4 * math.radians(8) / math.sqrt(1000)
        assert yaws.std() == pytest.approx(math.radians(8), rel=0.1)  # 2 degrees times the root of 16

    def test_the_yaw_rate_carries_the_walk_of_the_heading(self, drives):
        for seed, states in enumerate(drives):
            values = observed(corrupted_odometry(seed), states)
            error = wrap(values[:, YAW] - relative_poses(states)[:, 2])
            rate_error = values[:, YAW_RATE] - states[:, YAW_RATE]
            np.testing.assert_allclose(wrap(error - STEP_TIME * np.cumsum(rate_error)), 0, atol=1e-10)
            assert np.abs(error[1:]).min() > 0


class TestTrack:
    ACTIONS = tuple(np.random.default_rng(0).integers(6, size=60).tolist())

    def observations(self, level: int, seed: int = 3) -> list[dict[str, np.ndarray]]:
        env = mazebench.load("adrift", level=level, seed=seed, odometry_noise=0.0)
        return [env.reset().observation, *(env.step(action).observation for action in self.ACTIONS)]

    def test_only_the_odometry_differs_at_level_3(self):
        for exact_one, drifting in zip(self.observations(2), self.observations(3), strict=True):
            np.testing.assert_array_equal(exact_one["lidar"], drifting["lidar"])
            np.testing.assert_allclose(drifting["state"][6:8], exact_one["state"][6:8], rtol=0.1001)
        assert np.abs(drifting["state"][[X, Y, YAW]] - exact_one["state"][[X, Y, YAW]]).min() > 1e-4

    def test_the_goal_conditioned_environment_is_refused(self):
        with pytest.raises(InputError, match=r"goal-conditioned environment: expected .*no track"):
            GoalMazeEnv(Task.of("adrift"))
