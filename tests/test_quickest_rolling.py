"""The drives of rolling bodies: their model is MuJoCo's, their drives are quick, and robots drive them on time."""

from __future__ import annotations

import dataclasses
import math
import time

import numpy as np
import pytest
from mazebench_agents.robot.quickest import make_course
from mazebench_agents.robot.quickest_rolling import quickest_roll
from mazebench_agents.robot.rolling import RollingMotion, rolled
from simple_mazes import corridor

import mazebench
from mazebench.constants import NUM_ACTIONS, STEP_TIME, STEPS_PER_ACTION
from mazebench.evaluation.measured_oracle import measure_oracle_steps
from mazebench.maps.kinds import generate
from mazebench.results.reading import load_result
from mazebench.tasks.task import Task
from mazebench.tasks.trials import draw_trials
from mazebench.world.bodies import BODIES
from mazebench.world.models import models_of
from mazebench.world.simulation import MujocoSimulation

every_body = pytest.mark.parametrize("body", [BODIES["turtlebot3"], BODIES["service"]], ids=lambda body: body.name)


@every_body
@pytest.mark.parametrize("cell_size", [1.0, 0.8])
def test_a_step_is_that_of_the_world_also_in_contact_with_walls(body, cell_size):
    maze = dataclasses.replace(generate("dfs", 13, np.random.default_rng(0)), cell_size=cell_size)
    walls, motion = np.ascontiguousarray(maze.walls[::-1].T), RollingMotion.of(body)
    simulation = MujocoSimulation(models_of((maze,), body)[0])
    rng = np.random.default_rng(1)
    action, errors = 0, []
    for _ in range(1000):
        action = int(rng.integers(NUM_ACTIONS)) if rng.random() < 0.3 else action
        (x, y, yaw), (vx, vy, turn) = simulation.data.qpos.tolist(), simulation.data.qvel.tolist()
        expected = rolled(motion, walls, maze.cell_size, x, y, vx, vy, yaw, turn, action)
        simulation.set_controls(body.action_controls()[action])
        simulation.step(STEPS_PER_ACTION)
        errors.append(math.dist(expected[:2], simulation.position()))
        assert expected[4] == pytest.approx(simulation.data.qpos[2], abs=1e-3)
    assert np.quantile(errors, 0.95) < 0.002
    assert max(errors) < 0.02  # where a touch came a step of physics earlier or later
    assert np.median(errors) < 1e-4


class TestQuickestRoll:
    @every_body
    def test_a_straight_way_is_driven_straight(self, body):
        course = make_course(body, corridor().walls, 1.0, (1, 7))
        actions, poses = quickest_roll(course, (1.5, 7.5), (0.0, 0.0), math.pi, 0.0)
        # Backwards, which is as fast: 5.5 m to the goal cell, and the way that starting takes at half the speed.
        seconds = 5.5 / body.top_speed + body.top_speed / (2 * body.acceleration)
        assert actions.count(1) >= 0.9 * len(actions)
        assert len(actions) == pytest.approx(seconds / STEP_TIME, abs=1)
        assert poses[-2][0] < 7 < poses[-1][0]

    @every_body
    def test_a_drive_aslant_begins_with_a_turn(self, body):
        course = make_course(body, corridor().walls, 1.0, (1, 7))
        actions, _ = quickest_roll(course, (1.5, 7.5), (0.0, 0.0), math.pi / 2, 0.0)
        straight = len(quickest_roll(course, (1.5, 7.5), (0.0, 0.0), 0.0, 0.0)[0])
        assert straight < len(actions) <= straight + body.quarter_turn_steps + 2
        assert len(quickest_roll(course, (1.5, 7.5), (0.0, 0.0), 0.0, 0.0, num_steps=6)[0]) == 6

    @every_body
    def test_a_far_wider_search_gains_little_on_short_trips_and_a_trip_takes_less_than_a_second(self, body):
        task = Task.of("building", split="dev", body=body.name, distances=[15])
        rng, steps, best = np.random.default_rng(0), [], []
        for number in rng.choice(len(task.mazes), 20, replace=False).tolist():
            maze = task.mazes[number]
            start, goal = _ends(maze, 3, rng)
            course, yaw = make_course(body, maze.walls, 1.0, goal), rng.uniform(-math.pi, math.pi)
            drive = (tuple(maze.point(start)), (0.0, 0.0), yaw, 0.0)
            steps.append(len(quickest_roll(course, *drive)[0]))
            best.append(min(len(quickest_roll(course, *drive, width=150, held=held)[0]) for held in (1, 2)))
        assert np.sum(steps) < 1.05 * np.sum(best)

        start, goal = _ends(task.mazes[0], 40, rng)
        course = make_course(body, task.mazes[0].walls, 1.0, goal)
        begin = time.process_time()
        quickest_roll(course, tuple(task.mazes[0].point(start)), (0.0, 0.0), 1.0, 0.0)
        assert time.process_time() - begin < 5  # seconds on a busy machine; 1 on one that is not


def _ends(maze, distance: int, rng: np.random.Generator) -> tuple[tuple[int, int], tuple[int, int]]:
    """Returns a start and a goal so many cells apart."""
    while True:
        start, goal = rng.choice(maze.free_cells, 2).tolist()
        if maze.distance(tuple(start), tuple(goal)) == distance:
            return tuple(start), tuple(goal)


class TestRobots:
    @every_body
    @pytest.mark.parametrize(
        ("agent", "options", "share"),
        [
            ("navigator", {}, 1.0),
            ("navigator", {"actions": "diff"}, 1.0),
            ("navigator", {"actions": "four"}, 1.0),
            ("navigator", {"sensors": "lidar", "odometry_noise": 0.1}, 0.0),  # a wide body is slow in narrow ways
            ("planner-closed-loop", {"actions": "diff"}, 0.0),
            ("planner-closed-loop", {}, 0.0),
            ("llm-bfs", {}, 0.0),
        ],
    )
    def test_a_robot_reaches_its_goals(self, tmp_path, body, agent, options, share):
        mazes = [generate("rooms", 11, np.random.default_rng(seed)) for seed in range(2)]
        mazebench.evaluate(
            agent, mazes=mazes, distances=[6], episodes_per_distance=2, body=body.name, out=tmp_path, **options
        )
        records = load_result(tmp_path).records
        assert all(record.success for record in records)
        on_time = [record.steps <= 1.25 * record.oracle_steps for record in records]
        assert np.mean(on_time) >= share

    @every_body
    def test_the_oracle_drives_as_quickly_as_it_plans(self, body):
        task = Task.of(mazes=[generate("dfs", 13, np.random.default_rng(0))], distances=[8], body=body.name)
        trials = draw_trials(task, 4)
        for trial, steps in zip(trials, measure_oracle_steps(task, trials), strict=True):
            episode = trial.episode
            course = make_course(body, task.mazes[0].walls, 1.0, episode.goal)
            point = tuple(task.mazes[0].point(episode.start))
            planned = len(quickest_roll(course, point, (0.0, 0.0), episode.yaw, 0.0)[0])
            assert planned <= steps <= 1.1 * planned + 1
