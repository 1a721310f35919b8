"""The oracle is hard to beat: its model of the body is MuJoCo's, and its drives are quick and short."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from mazebench_agents.robot.motion import Motion, moved
from mazebench_agents.robot.moving_body import BACKWARD, LOOK_LEFT, LOOK_RIGHT
from mazebench_agents.robot.quickest import make_course, quickest_drive
from simple_mazes import CART, corridor, field

from mazebench.agent_loading import load_agent_class
from mazebench.constants import NUM_ACTIONS, STEPS_PER_ACTION
from mazebench.evaluation.chunk import Result, run_trials
from mazebench.evaluation.measured_oracle import measure_oracle_steps
from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze
from mazebench.tasks.task import Task
from mazebench.tasks.trials import draw_trials, frozen_trials
from mazebench.world.bodies import SLIDER
from mazebench.world.models import models_of
from mazebench.world.simulation import MujocoSimulation


def dfs(seed: int, size: int = 13, cell_size: float = 1.0) -> Maze:
    return dataclasses.replace(generate("dfs", size, np.random.default_rng(seed)), cell_size=cell_size)


def play(agent: str, task, trials) -> list[Result]:
    """The result of each trial."""
    interface = task.interface
    agent_class = load_agent_class(agent)
    steps = run_trials(
        agent_class.build(interface), task, dict(enumerate(trials)), 32, needs_truth=agent_class.needs_truth
    )
    return sorted(result for results in steps for result in results)


class TestMotion:
    @pytest.mark.parametrize("body", [SLIDER, CART], ids=lambda body: body.name)
    @pytest.mark.parametrize("cell_size", [1.0, 0.5])
    def test_a_step_is_that_of_the_world_also_in_contact_with_walls(self, cell_size, body):
        maze = dfs(0, cell_size=cell_size)
        walls = np.ascontiguousarray(maze.walls[::-1].T)
        simulation = MujocoSimulation(models_of((maze,), body)[0])
        rng = np.random.default_rng(1)
        action, errors = 0, []
        for _ in range(1000):
            action = int(rng.integers(NUM_ACTIONS)) if rng.random() < 0.5 else action
            (x, y), yaw, (vx, vy) = simulation.position(), simulation.yaw(), simulation.data.qvel[:2]
            heading = yaw + body.turn_step * ((action == LOOK_LEFT) - (action == LOOK_RIGHT))
            expected = moved(Motion.of(body), walls, maze.cell_size, x, y, vx, vy, heading, action)
            simulation.set_controls(body.action_controls()[action])
            simulation.step(STEPS_PER_ACTION)
            errors.append(math.dist(expected[:2], simulation.position()))
        assert np.quantile(errors, 0.95) < 0.002
        assert max(errors) < 0.05  # where a touch came a step of physics earlier or later


class TestQuickestDrive:
    def test_a_straight_way_is_driven_straight(self):
        course = make_course(SLIDER, corridor().walls, 1.0, (1, 7))
        actions, points = quickest_drive(course, (1.5, 7.5), (0.0, 0.0), math.pi)
        # Backwards, which is as fast: 2.7 of the 5.5 m to the goal cell in 6 steps, then half a metre a step.
        assert actions[:9] == [BACKWARD] * 9
        assert len(actions) == 12
        assert points[-2][0] < 7 < points[-1][0] < 7.2  # it lets go in time, to drive no further than it must

    def test_a_drive_that_is_cut_short_leads_towards_the_goal(self):
        course = make_course(SLIDER, field(21).walls, 1.0, (1, 19))
        actions, points = quickest_drive(course, (1.5, 1.5), (0.0, 0.0), 0.3, num_steps=10)
        assert len(actions) == 10
        assert math.dist(points[-1], (19.5, 19.5)) < math.dist((1.5, 1.5), (19.5, 19.5)) - 3


class TestOracle:
    def test_nobody_else_is_quicker_and_its_paths_are_short(self):
        task = Task.of(mazes=[dfs(seed) for seed in range(4)], distances=(3, 8, 14))
        trials = draw_trials(task, 3)
        ours, others = play("oracle", task, trials), play("planner-closed-loop", task, trials)
        assert all(result.success for result in ours)
        assert all(mine.steps <= other.steps for mine, other in zip(ours, others, strict=True))
        assert np.mean([other.steps / mine.steps for mine, other in zip(ours, others, strict=True)]) > 1.2
        # The episode ends within a step of the goal cell's edge; l ends there.
        assert all(result.path_length <= 1.2 * trials[result.number].shortest_path + 0.512 for result in ours)

    def test_it_takes_no_detour_over_landmarks(self):
        maze = dfs(4)
        local = Task.of(mazes=maze, start=(1, 11), goal=(11, 1), time_limit=300)
        [trial, *_] = draw_trials(local, 1)
        over_landmarks = Task.of("hierarchical", mazes=maze, landmark_distance=3)
        assert measure_oracle_steps(over_landmarks, [trial]) == measure_oracle_steps(local, [trial])

    def test_a_goal_that_it_does_not_reach_in_time_has_no_steps(self):
        task = Task.of(mazes=dfs(5), distances=(14,), time_limit=10)
        assert measure_oracle_steps(task, draw_trials(task, 1)) == [None]

    def test_frozen_steps_are_those_that_it_takes(self):
        trials = frozen_trials("local", 13)[::50]
        task = Task.of(size=13, split="eval")
        assert [trial.oracle_steps for trial in trials] == measure_oracle_steps(task, trials)
