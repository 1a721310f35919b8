"""The agent costmap-dwa: its costmap, its planners, and what it reaches and refuses."""

from __future__ import annotations

import math

import numpy as np
import pytest
from mazebench_agents.costmap_dwa import CostmapDWA
from mazebench_agents.costmap_dwa.costmap import Costmap, cost
from mazebench_agents.costmap_dwa.costmap_dwa import limits_of
from mazebench_agents.costmap_dwa.global_planner import cheapest_path
from mazebench_agents.costmap_dwa.window import best_velocities
from simple_mazes import field

from mazebench.agent import Interface
from mazebench.errors import UnplayableError
from mazebench.evaluation.evaluate import evaluate
from mazebench.maps.maze import Maze
from mazebench.world.bodies import BODIES

REACH = 5.0
TURTLEBOT3 = limits_of(BODIES["turtlebot3"])


def scan(x: float, y: float, side: float) -> np.ndarray:
    """Four ranges in an empty room from 1 m to `side` - 1 m: ahead (right), up, left and down."""
    return np.array([side - 1 - x, side - 1 - y, x - 1, y - 1])


class TestCostmap:
    def test_clearance_is_measured_from_the_middle_of_a_cell_to_that_of_a_wall(self):
        costmap = Costmap(field(5).walls.astype(float), 5.0)
        middle = costmap.clearance()[17, 17]  # of 35 cells a side, of which 7 are a metre
        assert middle == pytest.approx(11 / 7)

    def test_a_wall_that_the_lidar_sees_is_marked(self):
        costmap = Costmap(field(9).walls.astype(float), 9.0)
        before = costmap.clearance()
        costmap.sense(4.5, 4.5, 0.0, np.array([1.0, *scan(4.5, 4.5, 9)[1:]]), REACH)
        row, column = 63 - 1 - int(4.5 * 7), int(5.51 * 7)
        assert before[row, column] > 2
        assert costmap.clearance()[row, column] == 0

    def test_a_wall_that_rays_pass_is_cleared_until_it_is_forgotten(self):
        walls = field(9).walls.astype(float)
        walls[4, 5] = 1  # x from 5 to 6, y from 4 to 5
        costmap = Costmap(walls, 9.0)
        row, column = 63 - 1 - int(4.5 * 7), int(5.5 * 7)
        assert costmap.clearance()[row, column] == 0
        costmap.sense(4.5, 4.5, 0.0, scan(4.5, 4.5, 9), REACH)
        assert costmap.clearance()[row, column] > 0
        costmap.forget()
        assert costmap.clearance()[row, column] == 0

    def test_a_ray_that_meets_nothing_clears_nothing(self):
        walls = field(9).walls.astype(float)
        walls[4, 5] = 1
        costmap = Costmap(walls, 9.0)
        costmap.sense(4.5, 4.5, 0.0, np.full(4, REACH), REACH)
        assert costmap.clearance()[63 - 1 - int(4.5 * 7), int(5.5 * 7)] == 0

    def test_costs_decay_from_the_radius_to_the_end_of_the_inflation(self):
        assert [cost(0.1, 0.2), cost(0.2, 0.2), cost(0.8, 0.2)] == [1, 1, 0]
        assert cost(0.3, 0.2) == pytest.approx(math.exp(-0.3))


class TestGlobalPlanner:
    def test_a_path_goes_through_the_gap_and_keeps_off_the_walls(self):
        walls = np.pad(np.zeros((19, 19), dtype=bool), 1, constant_values=True)
        walls[10, 1:14] = True
        costmap = Costmap(walls.astype(float), 21 * 0.15)
        clearance = costmap.clearance()
        path = cheapest_path(clearance, costmap.cell, 0.14, (5, 3), (15, 3))
        assert path[0].tolist() == [5, 3]
        assert path[-1].tolist() == [15, 3]
        assert np.abs(np.diff(path, axis=0)).max() == 1
        assert clearance[tuple(path.T)].min() >= 0.14

    def test_there_is_no_path_through_a_gap_that_is_too_narrow(self):
        walls = np.pad(np.zeros((19, 19), dtype=bool), 1, constant_values=True)
        walls[10] = True
        walls[10, 10] = False
        clearance = Costmap(walls.astype(float), 21 * 0.15).clearance()
        assert len(cheapest_path(clearance, 0.15, 0.2, (5, 3), (15, 3))) == 0
        assert len(cheapest_path(clearance, 0.15, 0.14, (5, 3), (15, 3))) > 0


class TestWindow:
    OPEN = np.full((100, 100), 3.0)  # 5 m around (0, 0)

    def driven(self, path, clearance=OPEN, velocities=(0.2, 0.0)):
        return best_velocities(
            TURTLEBOT3, (0.0, 0.0, 0.0), velocities, np.array(path), clearance, (-2.5, 2.5), 0.05
        )  # fmt: skip

    def test_the_way_ahead_is_driven_at_top_speed(self):
        speed, rate, is_any, is_near = self.driven([(0.0, 0.0), (0.3, 0.0), (0.6, 0.0)])
        assert speed == pytest.approx(0.22)
        assert abs(rate) < 0.1
        assert (is_any, is_near) == (True, False)

    def test_it_turns_in_place_to_a_path_behind_it(self):
        speed, rate, *_ = self.driven([(0.0, 0.0), (-0.3, 0.1), (-0.6, 0.2)], velocities=(0.0, 0.0))
        assert speed < 0.05
        assert rate > 0.3

    def test_speeds_and_turns_are_those_that_a_step_can_reach(self):
        speed, rate, *_ = self.driven([(0.0, 0.0), (0.0, 0.6)], velocities=(0.0, -1.0))
        assert abs(rate + 1.0) <= 3.2 * 0.16 + 1e-9
        assert 0 <= speed <= 0.22

    def test_no_speed_leads_into_a_wall_ahead(self):
        columns = -2.475 + 0.05 * np.arange(100)  # x of the cells' middles
        wall = np.broadcast_to(np.maximum(0.2 - columns, 0), (100, 100))  # at x = 0.2, up to its edge 0.175
        speed, _, is_any, _ = self.driven([(0.0, 0.0), (0.6, 0.0)], wall)
        assert is_any
        assert speed * 0.16 + TURTLEBOT3.radius < 0.175


class TestAgent:
    def test_limits_are_those_of_the_body(self):
        assert TURTLEBOT3.acceleration == pytest.approx(2.5)
        assert TURTLEBOT3.turn_acceleration == pytest.approx(3.2)
        assert limits_of(BODIES["slider"]).acceleration > 0

    def test_it_refuses_odometry_and_other_sensors(self):
        with pytest.raises(UnplayableError, match=r"expected the pose on the map, found odometry with noise$"):
            CostmapDWA.build(Interface("local", 13, 13, "diff", odometry_noise=0.1))
        with pytest.raises(UnplayableError, match="expected the sensor lidar, found depth"):
            CostmapDWA.build(Interface("local", 13, 13, "diff", sensors=("depth",)))

    @pytest.mark.parametrize("body", ["turtlebot3", "service", "slider"])
    def test_it_reaches_all_goals_on_right_maps(self, body):
        found = evaluate("costmap-dwa", split="train", kinds="dfs", num_mazes=3, distances=(4,), body=body)
        assert found.overall.success_rate == 1

    def test_it_drives_around_a_door_that_was_closed(self):
        walls = np.ones((9, 9), dtype=bool)
        walls[1:8, 1:4] = walls[1:8, 5:8] = False
        walls[2, 4] = walls[6, 4] = False
        shown = Maze(walls, "shown")
        closed = walls.copy()
        closed[2, 4] = True
        options = {"mazes": Maze(closed, "true"), "shown": shown, "body": "turtlebot3", "distances": (14,)}
        assert evaluate("costmap-dwa", **options).overall.success_rate == 1
