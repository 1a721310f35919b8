"""The range sensor: worked numbers, MuJoCo's own ray casts, and the same readings in all three environments."""

from __future__ import annotations

import math

import gymnasium
import hypothesis
import mujoco
import numpy as np
import pytest
from dm_env import specs
from hypothesis import strategies

import mazebench
from mazebench.envs.dm_control import Environment
from mazebench.envs.gym import MazeEnv
from mazebench.envs.vector import MazeVectorEnv
from mazebench.maps.kinds import KINDS, generate
from mazebench.maps.maze import Maze
from mazebench.maps.text import parse_maze
from mazebench.tasks.task import Task
from mazebench.world.bodies import SLIDER
from mazebench.world.mjcf import maze_spec
from mazebench.world.ray_casting import MAX_RANGE, NUM_RAYS, Lidar, ray_ends

# Free are x from 1 to 3 m at y from 3 to 4 m, and below that x from 2 to 3 m down to y = 1 m.
CORNER = parse_maze("#####\n#..##\n##.##\n##.##\n#####")
QUARTER = NUM_RAYS // 4  # of a turn, in rays
STRAIGHT = (0.0, math.pi / 2, -math.pi / 4, 7 * math.pi, math.nextafter(math.pi, 0))


def ranges_of(maze: Maze, x: float, y: float, yaw: float) -> np.ndarray:
    return Lidar([maze]).ranges(np.array([0]), np.array([[x, y, yaw]]))[0]


def mujoco_ranges(maze: Maze, pose: np.ndarray) -> np.ndarray:
    """Ranges of MuJoCo's ray casts from the height of the body's centre: `[K, 32]` m, at most `MAX_RANGE`."""
    model = maze_spec(maze).compile()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    body = model.body("agent").id
    distances = np.empty((len(pose), NUM_RAYS))
    for (x, y, _), angles, found in zip(pose, angles_of(pose), distances, strict=True):
        rays = np.stack([np.cos(angles), np.sin(angles), np.zeros(NUM_RAYS)], axis=1).ravel()
        geoms = np.zeros(NUM_RAYS, dtype=np.int32)
        centre = np.array([x, y, SLIDER.height / 2])
        mujoco.mj_multiRay(model, data, centre, rays, None, True, body, geoms, found, None, NUM_RAYS, mujoco.mjMAXVAL)
    return np.minimum(distances, MAX_RANGE)


def angles_of(pose: np.ndarray) -> np.ndarray:
    """The rays' angles from +x: `[K, 32]` rad."""
    return pose[:, 2:] + np.arange(NUM_RAYS) * (2 * np.pi / NUM_RAYS)


def near_corners(maze: Maze, pose: np.ndarray) -> np.ndarray:
    """`[K, 32]` bool: which rays pass a corner of cells, within reach, at less than 1e-6 rad."""
    corners = np.stack(np.meshgrid(np.arange(maze.size + 1), np.arange(maze.size + 1)), axis=-1).reshape(-1, 2)
    to_corner = corners - pose[:, None, :2]  # [K, C, 2]
    angles = np.arctan2(to_corner[..., 1], to_corner[..., 0])[:, None] - angles_of(pose)[..., None]  # [K, 32, C]
    within_reach = (np.hypot(to_corner[..., 0], to_corner[..., 1]) < MAX_RANGE + 0.01)[:, None]
    return (within_reach & (np.abs(np.angle(np.exp(1j * angles))) < 1e-6)).any(axis=-1)


@strategies.composite
def mazes_and_poses(draw: strategies.DrawFn) -> tuple[Maze, np.ndarray]:
    """A maze of any kind and size, and 20 poses in its free cells, some of them close to a wall."""
    kind = draw(strategies.sampled_from(sorted(KINDS)))
    size = draw(strategies.integers(KINDS[kind].smallest, 51).filter(lambda size: size % 2 or not KINDS[kind].odd))
    rng = np.random.default_rng(draw(strategies.integers(0, 2**32)))
    maze = generate(kind, size, rng)
    cells = maze.free_cells[rng.integers(len(maze.free_cells), size=20)]
    margin = draw(strategies.sampled_from([0.15, 0.01, 1e-4]))
    within = np.where(rng.random((20, 2)) < 0.5, rng.uniform(margin, 1 - margin, (20, 2)), margin)
    within = np.where(rng.random((20, 2)) < 0.5, within, 1 - within)
    yaw = draw(strategies.one_of(strategies.floats(-30.0, 30.0), strategies.sampled_from(STRAIGHT)))
    yaws = np.where(rng.random(20) < 0.5, yaw, rng.uniform(-30, 30, 20))
    return maze, np.column_stack([cells[:, 1] + within[:, 0], size - 1 - cells[:, 0] + within[:, 1], yaws])


class TestRanges:
    def test_the_first_ray_looks_ahead_and_the_others_follow_counter_clockwise(self):
        ahead, left, behind, right = ranges_of(CORNER, 2.25, 3.5, 0.0)[::QUARTER]
        np.testing.assert_allclose([ahead, left, behind, right], [0.75, 0.5, 1.25, 2.5], atol=1e-6)

    def test_a_slanting_ray_ends_at_the_wall_that_it_meets_first(self):
        # Upwards at 45 degrees: 0.5 m to the wall above, 0.75 m to the one on the right.
        assert ranges_of(CORNER, 2.25, 3.5, math.pi / 4)[0] == pytest.approx(0.5 * math.sqrt(2), abs=1e-6)

    def test_rays_end_where_the_walls_are(self):
        ends = ray_ends(np.array([2.25, 3.5, 0.5]), ranges_of(CORNER, 2.25, 3.5, 0.5))
        assert ends.shape == (NUM_RAYS, 2)
        to_line = np.abs(ends - np.round(ends)).min(axis=1)
        np.testing.assert_allclose(to_line, 0, atol=1e-6)
        assert math.atan2(ends[0, 1] - 3.5, ends[0, 0] - 2.25) == pytest.approx(0.5)

    def test_walls_out_of_reach_are_reported_at_five_metres(self):
        walls = np.ones((13, 13), dtype=bool)
        walls[6, 1:12] = False
        ranges = ranges_of(Maze(walls), 1.5, 6.5, 0.0)
        assert (ranges[0], ranges[2 * QUARTER]) == (5.0, 0.5)
        assert ranges.max() == 5.0

    def test_a_body_that_stands_outside_does_no_harm(self):
        for x, y in ((0.0, 0.0), (-40.0, 2.5), (2.5, -40.0), (1e6, 1e6)):
            assert ((ranges_of(CORNER, x, y, 1.0) >= 0) & (ranges_of(CORNER, x, y, 1.0) <= MAX_RANGE)).all()

    @hypothesis.settings(max_examples=150, deadline=None)
    @hypothesis.given(mazes_and_poses())
    def test_ranges_are_those_of_mujocos_ray_casts(self, maze_and_poses):
        maze, pose = maze_and_poses
        found = Lidar([maze]).ranges(np.zeros(len(pose), dtype=np.int64), pose)
        compared = ~near_corners(maze, pose)
        assert (found.shape, found.dtype) == ((len(pose), NUM_RAYS), np.float32)
        np.testing.assert_allclose(found[compared], mujoco_ranges(maze, pose)[compared], rtol=0, atol=1e-3)
        assert compared.any()

    def test_a_body_has_the_same_ranges_whoever_is_beside_it(self):
        rng = np.random.default_rng(0)
        mazes = [generate("rooms", 13, rng) for _ in range(5)]
        index = rng.integers(5, size=67)
        cells = np.array([mazes[i].free_cells[rng.integers(len(mazes[i].free_cells))] for i in index])
        pose = np.column_stack([cells[:, 1] + 0.3, 12 - cells[:, 0] + 0.6, rng.uniform(-9, 9, 67)])
        lidar = Lidar(mazes)
        together = lidar.ranges(index, pose)
        for number in range(67):
            np.testing.assert_array_equal(lidar.ranges(index[number:], pose[number:])[0], together[number])
            np.testing.assert_array_equal(lidar.ranges(index[number, None], pose[None, number])[0], together[number])


class TestSensor:
    def test_all_environments_declare_the_sensor(self):
        spec = Task.of(sensors="lidar")
        expected = specs.BoundedArray((NUM_RAYS,), np.float32, 0.0, 5.0, name="lidar")
        assert Environment(spec).observation_spec()["lidar"] == expected
        assert MazeEnv(spec).observation_space["lidar"] == gymnasium.spaces.Box(0.0, 5.0, (NUM_RAYS,), np.float32)
        assert MazeVectorEnv(spec, 2).observation_space["lidar"].shape == (2, NUM_RAYS)
        goal = gymnasium.make("mazebench/LocalGoal-13-v1", sensors="lidar")
        assert goal.reset(seed=0)[0]["lidar"].shape == (NUM_RAYS,)

    def test_readings_are_of_the_true_maze_from_the_true_pose(self):
        env = mazebench.load(sensors="lidar", position_noise=0.5, map_flip=0.2, map_warp=0.2, seed=3)
        time_step = env.reset()
        for action in (4, 0, 0, 2, 5, 0):
            maze, pose = env.maze_task.mazes[env.task.episode.maze], env.physics.data.qpos
            np.testing.assert_array_equal(time_step.observation["lidar"], ranges_of(maze, *pose))
            time_step = env.step(action)
