"""The body moves as DeepMind Lab's does (DESIGN section 4) and never gets into a wall."""

from __future__ import annotations

import mujoco
import mujoco.batch
import numpy as np
import pytest
from simple_mazes import clearance

from mazebench.constants import ACTIONS, STEPS_PER_ACTION
from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze, point_to_cell
from mazebench.world.bodies import SLIDER
from mazebench.world.models import MazeModels
from mazebench.world.near_walls import NearWalls, WallGeoms
from mazebench.world.simulation import MujocoSimulation

STEPS_PER_FRAME = 2
FRAMES_PER_ACTION = 10
CONTROLS = SLIDER.action_controls()
DRIVES = ("forward", "backward", "strafe_left", "strafe_right")
# Where a drive leads, as an angle from the heading.
BEARINGS = {"forward": 0, "backward": np.pi, "strafe_left": np.pi / 2, "strafe_right": -np.pi / 2}
YAWS = np.random.default_rng(0).uniform(-np.pi, np.pi, size=2)
TURN = np.deg2rad(2.112)  # a frame

# DeepMind Lab's, 1 unit being 1 cm.
LAB_SPEEDS = {1: 0.51, 2: 0.93, 4: 1.73, 8: 2.93, 10: 3.20}  # m/s after so many frames from rest
LAB_TOP_SPEED = 3.2
LAB_STOPPING_DISTANCE = 0.4

ROUNDING = 1e-9


def open_maze(size: int, *walls: tuple[slice | int, slice | int]) -> Maze:
    grid = np.pad(np.zeros((size - 2, size - 2), dtype=bool), 1, constant_values=True)
    for block in walls:
        grid[block] = True
    return Maze(grid)


FIELD = open_maze(25)
MIDDLE = np.array([12.5, 12.5])


def simulation_at(maze: Maze, position, yaw: float = 0.0, velocity=(0.0, 0.0)) -> MujocoSimulation:
    simulation = MujocoSimulation(MazeModels([maze], SLIDER)[0])
    with simulation.reset_context():
        simulation.place_agent(np.asarray(position), yaw)
        simulation.data.qvel[:2] = velocity
    return simulation


def trajectory(simulation: MujocoSimulation, action: str | None, num_steps: int, nstep: int = 1) -> np.ndarray:
    """`[num_steps + 1, 6]`: x, y, yaw and their rates, now and after every `nstep` steps; None lets the body coast."""
    simulation.data.ctrl[:] = 0
    if action is not None:
        simulation.set_controls(CONTROLS[ACTIONS.index(action)])
    rows = [np.r_[simulation.data.qpos, simulation.data.qvel]]
    for _ in range(num_steps):
        simulation.step(nstep)
        rows.append(np.r_[simulation.data.qpos, simulation.data.qvel])
    return np.array(rows)


class TestDriving:
    @pytest.mark.parametrize("action", DRIVES)
    @pytest.mark.parametrize("yaw", YAWS)
    def test_speed_when_starting_from_rest_and_when_cruising(self, action, yaw):
        simulation = simulation_at(FIELD, MIDDLE, yaw)
        frames = trajectory(simulation, action, 12, STEPS_PER_FRAME)
        direction = np.array([np.cos(yaw + BEARINGS[action]), np.sin(yaw + BEARINGS[action])])
        along = frames[:, 3:5] @ direction
        for frame, expected in LAB_SPEEDS.items():
            assert along[frame] == pytest.approx(expected, rel=0.1), f"after {frame} frames"
        # implicitfast leaves out that the drives' damping couples x and y: the velocity turns by up to 0.3 degrees.
        np.testing.assert_allclose(frames[:, 3:5] - along[:, None] * direction, 0, atol=0.005 * LAB_TOP_SPEED)
        np.testing.assert_allclose(frames[:, 2], yaw, atol=ROUNDING)
        trajectory(simulation, action, 126)
        assert np.hypot(*simulation.data.qvel[:2]) == pytest.approx(LAB_TOP_SPEED, rel=0.001)

    @pytest.mark.parametrize("yaw", YAWS)
    def test_distance_when_stopping_from_top_speed(self, yaw):
        velocity = LAB_TOP_SPEED * np.array([np.cos(yaw), np.sin(yaw)])
        steps = trajectory(simulation_at(FIELD, MIDDLE, yaw, velocity), None, 250)
        assert np.hypot(*(steps[-1, :2] - MIDDLE)) == pytest.approx(LAB_STOPPING_DISTANCE, rel=0.1)
        assert np.hypot(*steps[-1, 3:5]) < 0.001


class TestTurning:
    @pytest.mark.parametrize(("action", "sign"), [("look_left", 1), ("look_right", -1)])
    @pytest.mark.parametrize("yaw", YAWS)
    def test_yaw_when_looking(self, action, sign, yaw):
        frames = trajectory(simulation_at(FIELD, MIDDLE, yaw), action, FRAMES_PER_ACTION, STEPS_PER_FRAME)
        assert frames[-1, 2] - yaw == pytest.approx(sign * np.deg2rad(21.12), rel=0.01)
        np.testing.assert_allclose(np.diff(frames[:, 2])[1:], sign * TURN, rtol=0.001)
        assert frames[1, 5] == pytest.approx(sign * TURN / 0.016, rel=0.02)  # the rate stands within a frame
        np.testing.assert_allclose(frames[:, :2] - MIDDLE, 0, atol=ROUNDING)

    def test_velocity_when_turning_at_speed(self):
        # Turning does not steer what is in motion: the body coasts on in the old direction.
        simulation = simulation_at(FIELD, MIDDLE, velocity=(LAB_TOP_SPEED, 0))
        steps = trajectory(simulation, "look_left", STEPS_PER_ACTION)
        np.testing.assert_allclose(steps[:, 4], 0, atol=ROUNDING)
        assert np.all(np.diff(steps[:, 3]) < 0)


class TestWalls:
    @pytest.mark.parametrize("heading", np.deg2rad([100, 120, 150]))
    def test_slide_when_coasting_along_a_wall(self, heading):
        # Against the left wall: what goes along it goes as far as in the open, so there is no friction.
        velocity = LAB_TOP_SPEED * np.array([np.cos(heading), np.sin(heading)])
        at_wall = trajectory(simulation_at(FIELD, (1.3, 12.5), 0.0, velocity), None, 250)
        in_open = trajectory(simulation_at(FIELD, MIDDLE, 0.0, velocity), None, 250)
        assert at_wall[:, 0].min() < 1.25
        np.testing.assert_allclose(at_wall[:, 1], in_open[:, 1], atol=1e-6)

    @pytest.mark.parametrize("heading", np.deg2rad([100, 135, 180]))
    def test_bounce_when_coasting_into_a_wall(self, heading):
        # How far a step takes the body past where the contact begins depends on where it comes from.
        velocity = LAB_TOP_SPEED * np.array([np.cos(heading), np.sin(heading)])
        for x in np.linspace(1.25, 1.35, 21):
            steps = trajectory(simulation_at(FIELD, (x, 12.5), 0.0, velocity), None, 100)
            assert steps[:, 3].max() < 0.05 * abs(velocity[0])

    @pytest.mark.parametrize("heading", np.deg2rad([100, 120, 150]))
    def test_slide_when_boxes_meet_in_a_flat_wall(self, heading):
        # The L's right face is made of two boxes, that of its foot and that of its stem.
        maze = open_maze(15, np.s_[8, 2:5], np.s_[8:14, 4])
        simulation = simulation_at(maze, (5.3, 2.5), heading)
        steps = trajectory(simulation, "forward", 400)
        along = steps[(steps[:, 1] > 4) & (steps[:, 1] < 6.5)]
        assert along[:, 0].max() < 5.25
        assert np.ptp(along[:, 0]) < 0.005
        assert np.ptp(along[:, 4]) < 0.02 * along[:, 4].mean()

    def test_body_when_driving_head_on_into_walls_and_corners(self):
        # Discs all round a wall block, at top speed, straight at its middle, its corners and past them.
        maze = open_maze(11, np.s_[5, 5])
        angles = np.arange(0, 2 * np.pi, np.pi / 12)
        offsets = np.linspace(-0.9, 0.9, 19)
        angle, offset = (grid.ravel() for grid in np.meshgrid(angles, offsets))
        ahead = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        aside = np.stack([-np.sin(angle), np.cos(angle)], axis=-1)
        batch = mujoco.batch.Batch(MazeModels([maze], SLIDER)[0], len(angle), 0)
        qpos, qvel, ctrl = batch.bind("qpos"), batch.bind("qvel"), batch.bind("ctrl")
        for action in ("forward", "look_left"):  # driving on and coasting
            qpos[:] = np.c_[np.array([5.5, 5.5]) - 1.5 * ahead + offset[:, None] * aside, angle]
            qvel[:] = np.c_[LAB_TOP_SPEED * ahead, np.zeros(len(angle))]
            ctrl[:] = SLIDER.action_controls()[ACTIONS.index(action)]
            for _ in range(150):
                batch.step(None, nstep=1)
                assert clearance(maze.walls, qpos[:, :2]).min() >= SLIDER.radius - 0.01

    @pytest.mark.parametrize(("kind", "size"), [("dfs", 13), ("rooms", 15), ("obstacles", 11)])
    def test_body_when_acting_at_random_for_thousands_of_steps(self, kind, size):
        num_mazes, num_actions = 8, 105
        rng = np.random.default_rng(size)
        mazes = [generate(kind, size, rng) for _ in range(num_mazes)]
        num_bodies = 8 * num_mazes
        maze_of_body = np.arange(num_bodies) % num_mazes
        walls = NearWalls(tuple(mazes), num_mazes, SLIDER)
        batch = mujoco.batch.Batch(walls.model, num_bodies, 0)
        geoms = WallGeoms.of_batch(batch)
        qpos, ctrl = batch.bind("qpos"), batch.bind("ctrl")
        for body, index in enumerate(maze_of_body):
            cells = mazes[index].free_cells
            row, column = cells[rng.integers(len(cells))]
            qpos[body] = column + 0.5, size - row - 0.5, rng.uniform(-np.pi, np.pi)
        actions = rng.integers(len(ACTIONS), size=num_bodies)
        visited = np.empty((num_actions * STEPS_PER_ACTION, num_bodies, 2))
        for step in range(len(visited)):
            if step % STEPS_PER_ACTION == 0:
                # Persistent, or the bodies would hardly leave their cells.
                changed = rng.random(num_bodies) < 0.3
                actions = np.where(changed, rng.integers(len(ACTIONS), size=num_bodies), actions)
                ctrl[:] = SLIDER.action_controls()[actions]
                walls.write(geoms, np.arange(num_bodies), maze_of_body, mazes[0].cell_index(qpos[:, :2]))
            batch.step(None, nstep=1)
            visited[step] = qpos[:, :2]
        for index, maze in enumerate(mazes):
            points = visited[:, maze_of_body == index].reshape(-1, 2)
            assert points.min() > 0
            assert points.max() < size
            row, column = point_to_cell(points, size).T
            assert not maze.walls[row, column].any()
            nearest = clearance(maze.walls, points).min()
            assert SLIDER.radius - 0.01 <= nearest < SLIDER.radius + 0.1  # walls were met
