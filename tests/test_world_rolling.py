"""Rolling bodies move as their equations say, never get into a wall, and play one episode in all environments."""

from __future__ import annotations

import math

import numpy as np
import pytest
from simple_mazes import clearance, field

from mazebench.constants import PHYSICS_TIMESTEP, STEP_TIME
from mazebench.envs.dm_control import Environment
from mazebench.envs.goal import GoalMazeEnv
from mazebench.envs.gym import MazeEnv
from mazebench.envs.vector import MazeVectorEnv
from mazebench.errors import InputError
from mazebench.maps.kinds import generate
from mazebench.tasks.task import Task
from mazebench.world.bodies import BODIES, RollingBody
from mazebench.world.models import models_of
from mazebench.world.near_walls import NearWalls
from mazebench.world.simulation import MujocoSimulation

ROLLING = [body for body in BODIES.values() if isinstance(body, RollingBody)]
every_body = pytest.mark.parametrize("body", ROLLING, ids=lambda body: body.name)
MIDDLE = np.array([12.5, 12.5])


class Drive:
    """A body in an open field, and where it has been after each physics step."""

    def __init__(self, body: RollingBody, yaw: float):
        self.body, self.simulation = body, MujocoSimulation(models_of((field(25),), body)[0])
        with self.simulation.reset_context():
            self.simulation.place_agent(MIDDLE, yaw)

    def on(self, forward: float, turn: float, seconds: float) -> np.ndarray:
        """Returns `[T, 6]`: x, y, yaw, the velocity ahead and to the left, and the yaw rate, from now on."""
        self.simulation.set_controls(self.body.velocity_controls(np.array([forward, 0.0, turn])))
        rows = []
        for step in range(round(seconds / PHYSICS_TIMESTEP) + 1):
            if step:
                self.simulation.step(1)
            (x, y, yaw), (vx, vy, rate) = self.simulation.data.qpos, self.simulation.data.qvel
            cosine, sine = math.cos(yaw), math.sin(yaw)
            rows.append((x, y, yaw, cosine * vx + sine * vy, cosine * vy - sine * vx, rate))
        return np.array(rows)


class TestEquations:
    @every_body
    @pytest.mark.parametrize("yaw", [0.0, 0.7, 2.5])
    def test_speeds_accelerations_and_the_stopping_way(self, body, yaw):
        drive = Drive(body, yaw)
        starting = drive.on(1, 0, 4)
        halfway = round(0.5 * body.top_speed / body.acceleration / PHYSICS_TIMESTEP)
        assert starting[halfway, 3] == pytest.approx(body.acceleration * halfway * PHYSICS_TIMESTEP, rel=0.02)
        assert starting[-1, 3] == pytest.approx(body.top_speed, rel=0.02)
        stopping = drive.on(0, 0, 4)
        way = math.dist(stopping[0, :2], stopping[-1, :2])
        # v^2 / 2a, but that a physics step moves the body by the velocity at its end.
        half_step = body.top_speed * PHYSICS_TIMESTEP / 2
        assert way == pytest.approx(body.top_speed**2 / (2 * body.acceleration) - half_step, rel=0.02)
        assert abs(stopping[-1, 3]) < 1e-6
        np.testing.assert_allclose(stopping[:, 2], yaw, atol=1e-9)
        back = drive.on(-1, 0, 4)
        assert back[-1, 3] == pytest.approx(-body.top_speed, rel=0.02)

    @every_body
    def test_turns(self, body):
        drive = Drive(body, 0.3)
        rows = drive.on(0, 1, 6)
        halfway = round(0.5 * body.turn_rate / body.turn_acceleration / PHYSICS_TIMESTEP)
        assert rows[halfway, 5] == pytest.approx(body.turn_acceleration * halfway * PHYSICS_TIMESTEP, rel=0.02)
        assert rows[-1, 5] == pytest.approx(body.turn_rate, rel=0.02)
        assert body.turn_step == pytest.approx(body.turn_rate * STEP_TIME)
        np.testing.assert_allclose(rows[:, :2], np.broadcast_to(MIDDLE, (len(rows), 2)), atol=1e-9)
        on = drive.on(0, 0, 4)
        assert on[-1, 2] - on[0, 2] == pytest.approx(body.rest_turn(body.turn_rate), rel=0.02)

    @every_body
    def test_a_quarter_turn_takes_the_steps_that_the_body_says(self, body):
        quickest = next(
            steps
            for steps in range(1, 40)
            if any(_turned(body, turning, steps) >= math.pi / 2 for turning in range(1, steps + 1))
        )
        assert abs(body.quarter_turn_steps - quickest) <= 1  # it is commanded for whole agent steps

    @every_body
    def test_it_does_not_slip_aside(self, body):
        drive = Drive(body, 1.0)
        rng = np.random.default_rng(0)
        for _ in range(40):
            rows = drive.on(*rng.uniform(-1, 1, 2), 0.4)
            bound = 1.1 * PHYSICS_TIMESTEP * body.top_speed * body.turn_rate
            assert np.abs(rows[:, 4]).max() <= bound
            assert bound < 0.03 * body.top_speed

    @every_body
    @pytest.mark.parametrize(("forward", "turn"), [(1.0, 0.5), (0.5, -1.0), (-1.0, 0.3)])
    def test_an_arc_has_the_radius_of_its_velocities(self, body, forward, turn):
        drive = Drive(body, 0.0)
        drive.on(forward, turn, 3)
        rate, radius = turn * body.turn_rate, abs(forward * body.top_speed / (turn * body.turn_rate))
        rows = drive.on(forward, turn, 2 * math.pi / abs(rate))
        assert np.ptp(rows[:, 0]) / 2 == pytest.approx(radius, rel=0.02)
        assert np.ptp(rows[:, 1]) / 2 == pytest.approx(radius, rel=0.02)


def _turned(body: RollingBody, turning: int, steps: int) -> float:
    """Returns the rad that a body has turned after so many steps of a turn and the rest of them at rest; 0 if not."""
    drive = Drive(body, 0.0)
    drive.on(0, 1, turning * STEP_TIME)
    rows = drive.on(0, 0, (steps - turning) * STEP_TIME)
    return rows[-1, 2] if abs(rows[-1, 5]) < 0.01 else 0.0


class TestWalls:
    @every_body
    @pytest.mark.parametrize("kind", ["dfs", "rooms"])
    def test_it_moves_near_walls_as_in_the_whole_maze_and_stays_out_of_them(self, body, kind):
        maze = generate(kind, 13, np.random.default_rng(1))
        walls, of_actions = NearWalls((maze,), 1, body), body.action_controls()
        whole, near = MujocoSimulation(models_of((maze,), body)[0]), MujocoSimulation(walls.model, walls)
        rng = np.random.default_rng(0)
        contacts = 0
        for start in rng.choice(maze.free_cells, 6).tolist():
            near.surround(0, start[0] * maze.size + start[1])
            yaw = rng.uniform(-math.pi, math.pi)
            for simulation in (whole, near):
                with simulation.reset_context():
                    simulation.place_agent(maze.point(tuple(start)), yaw)
            for _ in range(round(16 / body.top_speed)):
                controls = of_actions[rng.choice(6, p=[0.6, 0.1, 0.1, 0.1, 0.05, 0.05])]
                row, column = maze.cell_at(*near.position())
                near.surround(0, row * maze.size + column)
                for simulation in (whole, near):
                    simulation.set_controls(controls)
                    simulation.step(20)
                np.testing.assert_array_equal(near.data.qpos, whole.data.qpos)
                np.testing.assert_array_equal(near.data.qvel, whole.data.qvel)
                assert clearance(maze.walls, near.position()[None])[0] > body.radius - 0.01
                assert np.hypot(*near.data.qvel[:2]) < body.fastest
                contacts += near.data.ncon
        assert contacts > 20


class TestEnvironments:
    @every_body
    @pytest.mark.parametrize("kind", ["six", "four", "diff"])
    def test_an_episode_is_the_same_in_all_of_them(self, body, kind):
        maze = generate("dfs", 9, np.random.default_rng(0))
        task = Task.of(mazes=maze, distances=[2], time_limit=40, body=body.name, actions=kind, sensors="lidar")
        rng = np.random.default_rng(1)
        count = {"six": 6, "four": 4}.get(kind, 0)
        actions = rng.integers(count, size=(60, 2)) if count else rng.uniform(-1, 1, (60, 2, 2)).astype(np.float32)
        single, goal, dm = MazeEnv(task), GoalMazeEnv(task), Environment(task)
        vector = MazeVectorEnv(task, 2)
        observed, _ = vector.reset(seed=[3, 4])
        (one, _), (goals, _), step = single.reset(seed=4), goal.reset(seed=4), dm.reset(seed=4)
        for action in actions:
            for key in ("state", "context", "lidar"):
                np.testing.assert_array_equal(observed[key][1], one[key])
                np.testing.assert_array_equal(step.observation[key], one[key])
            np.testing.assert_array_equal(goals["observation"][:12], one["state"])
            if step.last():
                break
            observed, _, terminated, truncated, infos = vector.step(action)
            one, goals, step = single.step(action[1])[0], goal.step(action[1])[0], dm.step(action[1])
            if terminated[1] or truncated[1]:
                observed = infos["final_obs"][1]
                observed = {key: [None, value] for key, value in observed.items()}
        assert step.last()

    def test_what_strafes_is_refused(self):
        with pytest.raises(InputError, match=r"turtlebot3.*strafe.*six, four or diff.*velocity"):
            Task.of(body="turtlebot3", actions="velocity")

    def test_a_maze_that_is_too_narrow_is_refused(self):
        maze = generate("dfs", 9, np.random.default_rng(0))
        with pytest.raises(InputError, match=r"service.*at least 0.76 m.*found 0.7 m"):
            Task.of(mazes=maze, cell_size=0.7, body="service")
        Task.of(mazes=maze, cell_size=0.7, body="turtlebot3")
