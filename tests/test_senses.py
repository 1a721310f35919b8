"""Noise on the lidar and on the observed motion: what is drawn, when, and where results say so."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from typing import Any

import gymnasium
import numpy as np
import pytest
from made_results import edit_records, edit_task, make_result

import mazebench
from mazebench.constants import STEP_TIME
from mazebench.envs.goal import GoalMazeEnv
from mazebench.envs.gym import MazeEnv
from mazebench.envs.vector import MazeVectorEnv
from mazebench.errors import InputError
from mazebench.evaluation.eval_options import EvalOptions, RunOptions, eval_options
from mazebench.evaluation.evaluate import run_evaluation
from mazebench.evaluation.plan import make_plan
from mazebench.report.leaderboard import Credit, read_entries
from mazebench.results.comparison import compare_folders
from mazebench.results.naming import described, noise_in_words
from mazebench.results.paper import printed_mmn
from mazebench.results.reading import load_result
from mazebench.tasks.episode import Episode, sample_episode
from mazebench.tasks.observation import state_errors
from mazebench.tasks.perturbations.odometry import MotionNoise, NoisyMotion
from mazebench.tasks.sensors.lidar import LidarOptions, read
from mazebench.tasks.task import Task
from mazebench.world.angles import wrap_angle
from mazebench.world.ray_casting import TURTLEBOT3, LidarModel

NOISE = {"sensors": "lidar", "lidar_noise": "turtlebot3", "odometry_noise": 0.2}
X, Y, YAW, FORWARD, LEFT, YAW_RATE = 0, 1, 5, 6, 7, 11  # indices in the state


def generators(count: int) -> list[np.random.Generator | None]:
    return [np.random.default_rng(seed) for seed in range(count)]


class TestLidar:
    def test_golden_readings(self):
        ranges = np.linspace(0.05, 4.0, 32, dtype=np.float32).clip(max=3.5)[None]
        near = [0.12, 0.165, 0.3, 0.435, 0.57, 0.69, 0.81, 0.93, 1.08, 1.215, 1.32, 1.44, 1.575, 1.725, 1.83, 1.95]
        far = [3.5, 2.205, 2.34, 2.46, 2.595, 2.73, 2.85, 2.97, 3.105, 3.24, 3.345, 3.495, 3.5, 3.5, 3.5, 3.5]
        readings = read(ranges, TURTLEBOT3, [np.random.default_rng(5)])[0]
        np.testing.assert_allclose(readings, [*near, *far], atol=1e-6)

    def test_noise_and_lost_rays_are_as_many_as_the_model_says(self):
        model = LidarModel(max_range=5.0, sigma=0.1, lost=0.05)
        readings = read(np.full((5000, 32), 2.0, np.float32), model, generators(5000))
        lost = readings == 5.0
        assert lost.mean() == pytest.approx(0.05, abs=4 * math.sqrt(0.05 * 0.95 / lost.size))
        assert readings[~lost].std() == pytest.approx(0.1, rel=0.01)
        assert readings[~lost].mean() == pytest.approx(2.0, abs=0.001)

    def test_without_a_generator_nothing_is_drawn(self):
        ranges = np.array([[0.05, 1.0, 1.004, 3.5] * 8], np.float32)
        expected = np.array([[0.12, 1.005, 1.005, 3.5] * 8], np.float32)
        np.testing.assert_array_equal(read(ranges, TURTLEBOT3, [None]), expected)

    @pytest.mark.parametrize(
        ("text", "model"),
        [
            ("turtlebot3", TURTLEBOT3),
            (".1,.1", LidarModel(sigma=0.1, lost=0.1)),
            ("0, 1", LidarModel(sigma=0.0, lost=1.0)),
            (None, LidarModel()),
        ],
    )
    def test_the_option_names_a_model(self, text, model):
        options = LidarOptions(lidar_noise=text)
        assert options.lidar == model
        assert LidarOptions(lidar_noise=options.lidar_noise) == options

    def test_the_sensor_sees_as_far_as_the_model(self):
        spec = Task.of(sensors="lidar", lidar_noise="turtlebot3")
        box = MazeEnv(spec).observation_space["lidar"]
        assert (box.low.min(), box.high.max()) == (0.0, 3.5)  # 0 where other libraries have no reading
        env, exact = MazeEnv(Task.of(sensors="lidar"), 0), MazeEnv(spec, 0)
        true, seen = (each.reset()[0]["lidar"].clip(0, 3.5) for each in (env, exact))
        assert np.abs(seen - true)[seen < 3.5].max() < 0.06


def states_along(moves: list[tuple[float, float]], heading: float = 0.0) -> np.ndarray:
    """`[T + 1, 12]`: true states of a body that goes ahead by metres and then turns by rad, from (3, 4).

    The velocities are those with which the last step was made, in the body's frame after it.
    """
    x, y, yaw = 3.0, 4.0, heading
    states = [np.array([x, y, 0.28, 0, 0, yaw, 0, 0, 0, 0, 0, 0])]
    for ahead, turn in moves:
        x, y, yaw = x + ahead * math.cos(yaw), y + ahead * math.sin(yaw), wrap_angle(yaw + turn)
        forward, left = ahead * math.cos(turn) / STEP_TIME, -ahead * math.sin(turn) / STEP_TIME
        states.append(np.array([x, y, 0.28, 0, 0, yaw, forward, left, 0, 0, 0, turn / STEP_TIME]))
    return np.array(states)


def observed(states: np.ndarray, alpha: float, seed: int = 0) -> np.ndarray:
    """`[T + 1, 12]`: what is observed of true states in turn."""
    states, add_noise = states.copy(), NoisyMotion(alpha, np.random.default_rng(seed))
    for state in states:
        add_noise(state)
    return states


def last_errors(moves: list[tuple[float, float]], alpha: float, count: int = 4000) -> np.ndarray:
    """`[count, 3]`: errors of x, y (m) and yaw (rad) at the end of a drive that begins towards +x."""
    states = states_along(moves)
    found = np.array([observed(states, alpha, seed)[-1, [X, Y, YAW]] for seed in range(count)])
    errors = found - states[-1, [X, Y, YAW]]
    errors[:, 2] = wrap_angle(errors[:, 2])
    return errors


def amcl(moves: list[tuple[float, float]], alpha: float, count: int = 20000) -> np.ndarray:
    """`[count, 3]`: poses after AMCL's update of its samples, once a move that goes ahead and turns, from 0."""
    rng, poses = np.random.default_rng(0), np.zeros((count, 3))
    for ahead, turn in moves:
        along, across, about = rng.normal(0.0, math.sqrt(alpha * ahead**2 + alpha * turn**2), (3, count))
        cosine, sine = np.cos(poses[:, 2]), np.sin(poses[:, 2])
        poses[:, 0] += (ahead + along) * cosine + across * sine
        poses[:, 1] += (ahead + along) * sine - across * cosine
        poses[:, 2] += turn + about
    return poses


class TestMotion:
    STRAIGHT = [(0.25, 0.0)] * 8  # 2 m
    TURN = [(0.0, math.pi / 8)] * 4  # a quarter

    def test_golden_poses(self):
        states = observed(states_along([(0.5, 0.0), (0.25, 0.3), (0.0, 0.3), (0.1, 0.0), (0.1, 0.0)]), 0.2)
        expected = [
            (3.0, 4.0, 0.0),
            (3.52811413, 4.02953955, 0.14320286),
            (3.78033664, 4.16042559, 0.50635272),
            (3.97760936, 4.07190279, 0.71193673),
            (3.99226404, 4.12136481, 0.71378488),  # .1 m and another one are of one segment, with the same errors
            (4.00682728, 4.17085384, 0.71563304),
        ]
        np.testing.assert_allclose(states[:, [X, Y, YAW]], expected, atol=1e-7)

    @pytest.mark.parametrize("moves", [STRAIGHT, TURN, [*STRAIGHT, *TURN, *STRAIGHT]])
    def test_the_errors_are_amcls(self, moves):
        found, expected = last_errors(moves, 0.2), amcl(moves, 0.2)
        expected -= states_along(moves)[-1, [X, Y, YAW]] - (3, 4, 0)
        expected[:, 2] = wrap_angle(expected[:, 2])
        np.testing.assert_allclose(found.std(axis=0), expected.std(axis=0), rtol=0.06)
        np.testing.assert_allclose(found.mean(axis=0), expected.mean(axis=0), atol=0.05)

    @pytest.mark.parametrize(("part", "count"), [((0.0625, 0.0), 4), ((0.0, 0.0625), 4)])
    def test_the_heading_does_not_depend_on_the_number_of_steps_in_a_segment(self, part, count):
        whole = [(count * part[0], count * part[1])] * 5  # .25 m or .25 rad each, so that each is a segment
        fine, coarse = observed(states_along([part] * 5 * count), 0.2), observed(states_along(whole), 0.2)
        np.testing.assert_allclose(fine[::count, YAW], coarse[:, YAW], atol=1e-12)

    def test_the_velocities_carry_the_errors_of_the_pose(self):
        rng = np.random.default_rng(0)
        true = states_along(rng.uniform(-0.5, 0.5, (50, 2)).tolist(), heading=1.0)
        states = observed(true, 0.2)
        turns = STEP_TIME * states[1:, YAW_RATE]
        np.testing.assert_allclose(wrap_angle(np.diff(states[:, YAW])), wrap_angle(turns), atol=1e-12)

        # The velocities are seen from where the body truly points after a step.
        heading = states[:-1, YAW] + STEP_TIME * true[1:, YAW_RATE]
        cosine, sine = np.cos(heading), np.sin(heading)
        forward, left = states[1:, FORWARD], states[1:, LEFT]
        steps = STEP_TIME * np.column_stack([cosine * forward - sine * left, sine * forward + cosine * left])
        np.testing.assert_allclose(np.diff(states[:, :2], axis=0), steps, atol=1e-12)


ACTIONS = np.random.default_rng(0).integers(6, size=60)
SPECS = {
    "local": {"time_limit": 12, **NOISE},
    "hierarchical": {"task": "hierarchical", "landmark_distance": 2, "time_limit": 12, **NOISE},
    "adrift": {"task": "adrift", "level": (1, 3), "lidar_noise": ".1,.1", "odometry_noise": 0.05},
}


def alone(spec: Task, seed: int) -> Iterator[dict[str, np.ndarray]]:
    """Yields the observations of the Gymnasium environment, episode after episode, the last of an episode included."""
    env = MazeEnv(spec)
    observation, _ = env.reset(seed=seed)
    yield observation
    for action in ACTIONS.tolist():
        observation, _, terminated, truncated, _ = env.step(action)
        yield observation
        if terminated or truncated:
            observation, _ = env.reset()
            yield observation


def side_by_side(spec: Task, seed: int, num_envs: int) -> Iterator[dict[str, np.ndarray]]:
    """Yields the same observations as `alone`, of the last slot of a vector environment."""
    env = MazeVectorEnv(spec, num_envs, num_threads=1)
    with contextlib.closing(env):
        observation, _ = env.reset(seed=[*range(100, 99 + num_envs), seed])
        yield {name: values[-1] for name, values in observation.items()}
        for step, action in enumerate(ACTIONS.tolist()):
            actions = np.full(num_envs, (action + step) % 6)
            actions[-1] = action
            observation, _, terminated, truncated, info = env.step(actions)
            if terminated[-1] or truncated[-1]:
                yield info["final_obs"][-1]
            yield {name: values[-1] for name, values in observation.items()}


@pytest.mark.parametrize("name", SPECS)
def test_all_environments_observe_the_same(name):
    spec = Task.of(**SPECS[name])
    count = 0
    for expected, found in zip(alone(spec, 3), side_by_side(spec, 3, 3), strict=True):
        for key, values in expected.items():
            np.testing.assert_array_equal(found[key], values, err_msg=f"{key} of observation {count}")
        count += 1
    assert count > len(ACTIONS)


def test_dm_control_observes_the_same():
    spec = Task.of(**NOISE)
    environment, env = mazebench.load(**NOISE, seed=3), MazeEnv(spec)
    expected = environment.reset().observation
    found, _ = env.reset(seed=3)
    for action in ACTIONS[:20].tolist():
        np.testing.assert_array_equal(found["lidar"], expected["lidar"])
        np.testing.assert_array_equal(found["state"], expected["state"])
        found, expected = env.step(action)[0], environment.step(action).observation
    assert environment.observation_spec()["lidar"].maximum == 3.5


def test_goal_conditioned_and_registered_environments_take_the_options():
    env = GoalMazeEnv(Task.of(**NOISE))
    assert env.observation_space.contains(env.reset(seed=0)[0])
    made = gymnasium.make("mazebench/Adrift-v1", lidar_noise=".1,.1", odometry_noise=0.2)
    assert made.observation_space["lidar"].high.max() == 5.0


def test_a_slot_without_an_episode_draws_nothing():
    spec = Task.of(**NOISE, time_limit=5)
    rng = np.random.default_rng(0)
    first, second = (sample_episode(spec, rng) for _ in range(2))

    def readings(queues: list[list[Episode]]) -> list[np.ndarray]:
        env = MazeVectorEnv(spec, 2, num_threads=1, episode_source=lambda i: queues[i].pop(0) if queues[i] else None)
        with contextlib.closing(env):
            observation, _ = env.reset()
            found = [observation["lidar"][1]]
            for action in ACTIONS[:9]:
                observation, *_ = env.step(np.array([0, action]))
                found.append(observation["lidar"][1])
        return found

    together, rested = readings([[first, second], [second, first]]), readings([[first], [second, first]])
    np.testing.assert_array_equal(together, rested)


def test_a_state_that_is_restored_goes_on_with_the_same_noise():
    env = MazeEnv(Task.of(**NOISE), 0)
    env.reset()
    for action in ACTIONS[:10].tolist():
        env.step(action)
    state = env.get_state()
    runs = []
    for _ in range(2):
        env.set_state(state)
        runs.append([env.step(action)[0] for action in ACTIONS[10:20].tolist()])
    for first, second in zip(*runs, strict=True):
        np.testing.assert_array_equal(first["lidar"], second["lidar"])
        np.testing.assert_array_equal(first["state"], second["state"])


def test_each_noise_has_a_stream_of_its_own():
    episodes = [sample_episode(Task.of(), np.random.default_rng(0))] * 3
    envs = [MazeEnv(Task.of(**NOISE | changes)) for changes in ({}, {"lidar_noise": None}, {"odometry_noise": None})]
    both, moving, sensing = (
        env.reset(options={"episode": episode}) and [env.step(action)[0] for action in ACTIONS[:10].tolist()]
        for env, episode in zip(envs, episodes, strict=True)
    )
    for all_noise, only_motion, only_lidar in zip(both, moving, sensing, strict=True):
        np.testing.assert_array_equal(all_noise["state"], only_motion["state"])
        np.testing.assert_array_equal(all_noise["lidar"], only_lidar["lidar"])


class TestOptions:
    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({"lidar_noise": "turtlebot3"}, r"^lidar_noise turtlebot3: expected the sensor lidar, found none$"),
            ({"sensors": "lidar", "lidar_noise": "turtlebot"}, r"expected lidar_noise 'turtlebot3', or SIGMA,LOST"),
            ({"sensors": "lidar", "lidar_noise": "2,.1"}, r"from 0 to 1 as '\.1,\.1', found '2,\.1'$"),
            (
                {"odometry_noise": 0.2, "position_noise": 0.1},
                r"^odometry_noise 0\.2: expected position_noise 0\.0, found 0\.1$",
            ),
            (
                {"task": "adrift", "odometry_noise": 0.2, "exact_pose": True},
                r"^odometry_noise 0\.2: expected exact_pose False, found True$",
            ),
        ],
    )
    def test_what_is_not_allowed_is_refused(self, options, message):
        with pytest.raises(InputError, match=message):
            Task.of(**options)

    def test_a_track_has_senses_of_its_own_unless_others_are_set(self):
        spec = Task.of("adrift", level=(1, 3))
        assert spec.options.lidar == TURTLEBOT3
        assert MotionNoise(0.01) in spec.perturbations(1)
        assert MotionNoise(0.2) in spec.perturbations(3)
        assert spec.interface.odometry_noise == 0.2
        other = spec.replace(lidar_noise="0,0", odometry_noise=0.0)
        assert (other.options.lidar, other.interface.odometry_noise) == (LidarModel(), 0.0)
        assert not any(isinstance(each, MotionNoise) for each in other.perturbations(3))

        # The noise of an episode is that of its level.
        rng = np.random.default_rng(0)
        drawn = {state_errors(spec, sample_episode(spec, rng))[0].alpha for _ in range(20)}
        assert drawn == {0.01, 0.2}

    def test_the_true_pose_has_no_noise(self):
        spec = Task.of("adrift", exact_pose=True)
        assert state_errors(spec, sample_episode(spec, np.random.default_rng(0))) == []


def options(**values: Any) -> EvalOptions:
    return eval_options("planner", distances=(2,), episodes_per_distance=1, **values)


class TestResults:
    def test_an_agent_is_told(self):
        interface = make_plan(options(**NOISE)).task.interface
        assert (interface.lidar, interface.odometry_noise) == (TURTLEBOT3, 0.2)
        interface = make_plan(options()).task.interface
        assert (interface.lidar, interface.odometry_noise) == (None, 0.0)

    def test_records_and_summary_say_what_was_set(self, tmp_path):
        summary = run_evaluation(
            options(sensors="lidar", lidar_noise=".1,.10", odometry_noise=0.0), tmp_path, RunOptions()
        )
        result = load_result(tmp_path)
        said = {"lidar_noise": "0.1,0.1", "odometry_noise": 0.0}
        assert said.items() <= summary.to_dict()["task"].items()
        assert said.items() <= result.records[0].model_dump().items()
        assert noise_in_words(result.summary.task) == ("lidar noise 0.1,0.1", "odometry noise 0.0")
        assert printed_mmn(result.summary) == {}
        assert "lidar noise 0.1,0.1" in described(result.summary.task)

    def test_they_are_named_where_two_results_are_compared(self, tmp_path):
        plain, noisy = (make_result(tmp_path / name) for name in ("plain", "noisy"))
        edit_records(noisy, lambda record: record | {"odometry_noise": 0.2})
        edit_task(noisy, odometry_noise=0.2)
        assert "planner (odometry noise 0.2) in" in compare_folders(plain, noisy).title

    def test_the_leaderboard_refuses_them(self, tmp_path):
        folder = make_result(tmp_path / "noisy", task="rebuilt")
        edit_records(folder, lambda record: record | {"lidar_noise": "0,0"})
        edit_task(folder, lidar_noise="0,0")
        with pytest.raises(InputError, match=r"a track, with its senses, found eval rebuilt 1 lidar noise 0,0$"):
            read_entries([folder], Credit("A. Nobody", "none", "https://example.org"))
