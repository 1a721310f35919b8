"""The robot's toolbox: rays, cheapest ways and odometry by hand; and both of the agents' maps from the same scans."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mazebench_agents.belief_planner.evidence import NUM_EVIDENCE, SENSED, Readings, add_readings
from mazebench_agents.robot import rays
from mazebench_agents.robot.beams import beams_of
from mazebench_agents.robot.body import COASTING_TIME, Body
from mazebench_agents.robot.cells import nearest_cell
from mazebench_agents.robot.occupancy import Occupancy
from mazebench_agents.robot.odometry import DeadReckoning
from mazebench_agents.robot.shortest_paths import cheapest_ways

from mazebench.constants import STEP_TIME
from mazebench.maps.kinds.dfs import dfs_walls
from mazebench.maps.kinds.obstacles import obstacles_walls
from mazebench.maps.maze import Maze
from mazebench.world.lidar import Lidar, LidarModel

METRE = np.array([[0, -1], [1, 0]], dtype=np.float32)  # a cell a metre, y up
BODY_RADIUS = 0.15
TOLD_TWICE = 0.5  # of SENSED: more than one ray tells. A single ray that ends near a corner may mark the wrong cell


def sensed(size: int, pose: tuple[float, float, float], ranges: np.ndarray) -> np.ndarray:
    """`[N, N]` float: what belief-planner's evidence has of a scan, from -1, free, to 1, wall."""
    x, y, yaw = pose
    still = np.zeros((1, 2), dtype=np.float32)
    planes = np.zeros((1, NUM_EVIDENCE, size, size), dtype=np.float32)
    reading = Readings(
        context=np.zeros(1, dtype=np.int64),
        on_leg=np.ones(1, dtype=bool),
        position=np.array([[size - y - 0.5, x - 0.5]], dtype=np.float32),
        velocity=still,
        wished=still,
        yaw=np.array([yaw], dtype=np.float32),
        ranges=ranges[None],
    )
    add_readings(planes, reading, METRE)
    return planes[0, SENSED]


@st.composite
def scans(draw):
    """A maze, a pose in it that the body may have, and what the lidar measures there."""
    size, style = draw(st.sampled_from([7, 9, 13])), draw(st.sampled_from([dfs_walls, obstacles_walls]))
    maze = Maze(style(size, np.random.default_rng(draw(st.integers(0, 2**32 - 1)))))
    row, column = maze.free_cells[draw(st.integers(0, len(maze.free_cells) - 1))]
    inside = st.floats(BODY_RADIUS, 1 - BODY_RADIUS)
    pose = column + draw(inside), size - 1 - row + draw(inside), draw(st.floats(-math.pi, math.pi))
    return maze, pose, Lidar((maze,)).ranges(np.array([0]), np.array([pose]))[0]


@settings(max_examples=300, deadline=None)
@given(scans())
def test_evidence_and_occupancy_agree_on_the_cells_that_both_decide(scan):
    maze, pose, ranges = scan
    occupancy = Occupancy.unseen(maze.size)
    for _ in range(2):
        occupancy.see(pose, ranges, beams_of(LidarModel(), 1.0), 0.01)
    evidence = sensed(maze.size, pose, ranges)
    decided = occupancy.is_seen() & (np.abs(evidence) > TOLD_TWICE)
    assert decided.sum() >= 1
    np.testing.assert_array_equal(evidence[decided] > 0, occupancy.evidence[decided] > 0)


@given(st.floats(0.01, 0.99), st.floats(0.01, 0.99), st.floats(-math.pi, math.pi))
def test_a_ray_leaves_each_cell_where_it_enters_the_next_one(x, y, angle):
    along_x, along_y = math.cos(angle), math.sin(angle)
    ray, entered = rays.ray_from(x + 3, y + 3, along_x, along_y), 0.0
    for _ in range(6):
        middle = (entered + rays.leaves_at(ray)) / 2
        within = 3 + x + middle * along_x - ray.column, 3 + y + middle * along_y - ray.level
        assert all(-1e-9 <= offset <= 1 + 1e-9 for offset in within)
        ray, entered = rays.in_next_cell(ray), rays.leaves_at(ray)


def test_cheapest_ways_by_hand():
    # The way ends in cell (1, 2). The middle cell is dear: from (1, 0), the way around it is as long as four cells.
    free, dear = np.zeros((3, 3)), np.ones((3, 3))
    dear[1, 1] = 4.0
    end = np.full((3, 3), np.inf)
    end[1, 2] = 0.5
    entered = cheapest_ways(dear, free, end)
    assert entered.cost[1].tolist() == [4.5, 1.5, 0.5]
    left = cheapest_ways(free, dear, end)
    assert left.cost[1].tolist() == [4.5, 4.5, 0.5]
    assert left.following.reshape(3, 3)[1].tolist() == [0, 5, 5]
    assert left.order[0] == 5


def test_cells_without_a_way_come_last():
    end = np.full((2, 2), np.inf)
    ways = cheapest_ways(np.full((2, 2), np.inf), np.zeros((2, 2)), end)
    assert sorted(ways.order.tolist()) == [0, 1, 2, 3]
    assert ways.following.tolist() == [0, 1, 2, 3]


def body(x: float, forward: float) -> Body:
    return Body(x=x, y=0.0, yaw=0.0, forward=forward, left=0.0)


@pytest.mark.parametrize(("gain", "expected"), [(0.0, 1 + 3 * STEP_TIME), (1.0, 7.0)])
def test_dead_reckoning_adds_up_mean_velocities_and_follows_positions_by_its_gain(gain, expected):
    odometry = DeadReckoning((1.0, 0.0), velocity=(2.0, 0.0), gain=gain)
    assert odometry.update(body(7.0, forward=4.0)).x == pytest.approx(expected)
    assert odometry.velocity == (4.0, 0.0)


def test_a_body_comes_to_rest_ahead_of_where_it_drives():
    assert Body(x=1.0, y=1.0, yaw=math.pi / 2, forward=2.0, left=0.0).rest() == pytest.approx(
        (1.0, 1 + 2 * COASTING_TIME)
    )


@pytest.mark.parametrize(("point", "cell"), [((0.5, 0.5), (4, 0)), ((4.9, 4.1), (0, 4)), ((-3.0, 9.0), (0, 0))])
def test_nearest_cell(point, cell):
    assert nearest_cell(*point, size=5) == cell


def test_costs_that_are_no_numbers_write_nowhere_else():
    rng = np.random.default_rng(0)
    for _ in range(50):
        end = rng.random((5, 5))
        end[rng.random((5, 5)) < 0.3] = np.nan
        ways = cheapest_ways.py_func(rng.random((5, 5)), rng.random((5, 5)), end)
        assert ways.order.shape == (25,)
