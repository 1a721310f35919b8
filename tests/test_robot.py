"""The robot's toolbox: rays, cheapest ways and odometry by hand; and the map that is made of scans."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mazebench_agents.robot import rays
from mazebench_agents.robot.cells import nearest_cell
from mazebench_agents.robot.dead_reckoning import DeadReckoning
from mazebench_agents.robot.moving_body import MovingBody
from mazebench_agents.robot.planning import cheapest_ways

from mazebench.constants import STEP_TIME
from mazebench.world.bodies import SLIDER


@settings(deadline=None)  # of the compilation
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


def body(x: float, forward: float) -> MovingBody:
    return MovingBody(SLIDER, x=x, y=0.0, yaw=0.0, forward=forward, left=0.0)


@pytest.mark.parametrize(("gain", "expected"), [(0.0, 1 + 3 * STEP_TIME), (1.0, 7.0)])
def test_dead_reckoning_adds_up_mean_velocities_and_follows_positions_by_its_gain(gain, expected):
    odometry = DeadReckoning((1.0, 0.0), velocity=(2.0, 0.0), gain=gain)
    assert odometry.update(body(7.0, forward=4.0)).x == pytest.approx(expected)
    assert odometry.velocity == (4.0, 0.0)


@pytest.mark.parametrize(("point", "cell"), [((0.5, 0.5), (4, 0)), ((4.9, 4.1), (0, 4)), ((-3.0, 9.0), (0, 0))])
def test_nearest_cell(point, cell):
    assert nearest_cell(*point, size=5) == cell
