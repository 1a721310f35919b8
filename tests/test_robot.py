"""The robot's toolbox: rays, cheapest ways and odometry by hand; and the map that is made of scans."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mazebench_agents.robot import rays
from mazebench_agents.robot.beams import beams_of
from mazebench_agents.robot.body import COASTING_TIME, Body
from mazebench_agents.robot.cells import nearest_cell
from mazebench_agents.robot.dead_reckoning import DeadReckoning
from mazebench_agents.robot.occupancy import Occupancy
from mazebench_agents.robot.shortest_paths import cheapest_ways

from mazebench.constants import STEP_TIME
from mazebench.maps.kinds.dfs import dfs_walls
from mazebench.maps.kinds.obstacles import obstacles_walls
from mazebench.maps.maze import Maze
from mazebench.world.ray_casting import Lidar, LidarModel

BODY_RADIUS = 0.15


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
def test_what_two_scans_tell_of_cells_is_true(scan):
    maze, pose, ranges = scan
    occupancy = Occupancy.unseen(maze.size)
    for _ in range(2):
        occupancy.see(pose, ranges, beams_of(LidarModel(), 1.0), 0.01)
    is_seen = occupancy.is_seen()
    assert is_seen.sum() >= 1
    np.testing.assert_array_equal(occupancy.evidence[is_seen] > 0, maze.walls[is_seen])


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
    dear, end = np.ones((3, 3)), np.full((3, 3), np.inf)
    dear[1, 1] = 4.0
    end[1, 2] = 0.5
    assert cheapest_ways(dear, end).reshape(3, 3)[1].tolist() == [0, 5, 5]


def test_cells_without_a_way_stay_where_they_are():
    end = np.full((2, 2), np.inf)
    assert cheapest_ways(np.full((2, 2), np.inf), end).tolist() == [0, 1, 2, 3]


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
