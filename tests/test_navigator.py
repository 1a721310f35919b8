"""The navigator: its occupancy grid, map reading, planning and driving, and what it reaches where the map is wrong."""

from __future__ import annotations

import numpy as np
import pytest
from mazebench_agents.navigator import driving, planning
from mazebench_agents.navigator.cell_map import wall_probability
from mazebench_agents.navigator.occupancy import Occupancy
from simple_mazes import field

from mazebench.agent import Interface
from mazebench.agent_loading import load_agent_class
from mazebench.errors import InputError
from mazebench.evaluation.chunk import Outcome, run_trials
from mazebench.maps.benchmark import load_mazes
from mazebench.maps.generators import dfs_walls, obstacles_walls
from mazebench.maps.maze import Maze
from mazebench.tasks.build import make_spec
from mazebench.tasks.spec import TaskSpec
from mazebench.tasks.tracks import TRACKS
from mazebench.tasks.trials import draw_trials, make_trial
from mazebench.world.lidar import Lidar

FREE, WALL = -1, 1


def seen(walls: np.ndarray, pose: tuple[float, float, float], ranges: list[float]) -> np.ndarray:
    """`[N, N]` int: -1 where a scan makes a cell free, 1 where it makes it a wall, on a map that tells nothing."""
    occupancy = Occupancy.of_map(np.full(walls.shape, 0.5))
    occupancy.see(*pose, np.array(ranges, dtype=np.float32))
    return np.sign(occupancy.evidence).astype(int)


class TestOccupancy:
    def test_a_ray_clears_the_cells_it_crosses_and_marks_the_wall_at_its_end(self):
        # From the middle of cell (2, 1) to the right: cells (2, 1) to (2, 3) are free, the wall begins at x = 4.
        expected = np.zeros((6, 6), dtype=int)
        expected[3, 1:4], expected[3, 4] = FREE, WALL
        np.testing.assert_array_equal(seen(np.zeros((6, 6)), (1.5, 2.5, 0.0), [2.5]), expected)

    def test_a_ray_of_full_range_ends_at_no_wall(self):
        found = seen(np.zeros((9, 9)), (1.5, 2.5, 0.0), [5.0])
        assert (found == FREE).sum() == 6
        assert (found == WALL).sum() == 0

    def test_a_ray_into_a_corner_marks_no_wall(self):
        # From (1.5, 1.5) along the diagonal to the corner (3, 3), where three cells meet that may all be walls.
        found = seen(np.zeros((5, 5)), (1.5, 1.5, np.pi / 4), [1.5 * np.sqrt(2)])
        assert (found == WALL).sum() == 0

    @pytest.mark.parametrize("style", [dfs_walls, obstacles_walls], ids=["corridors", "obstacles"])
    @pytest.mark.parametrize("deviation", [0.0, 0.03], ids=["sure", "uncertain"])
    def test_no_scan_contradicts_the_maze(self, style, deviation):
        rng = np.random.default_rng(0)
        num_seen = 0
        for _ in range(30):
            maze = Maze(style(13, rng))
            occupancy = Occupancy.of_map(np.full(maze.walls.shape, 0.5))
            for row, column in maze.free_cells[rng.integers(len(maze.free_cells), size=20)]:
                x, y = np.array([column, 12 - row]) + rng.uniform(0.15, 0.85, size=2)
                pose = np.array([[x, y, rng.uniform(-np.pi, np.pi)]])
                ranges = Lidar((maze,)).ranges(np.array([0]), pose)[0]
                x, y = np.array([x, y]) + rng.normal(0.0, deviation, size=2).clip(-2 * deviation, 2 * deviation)
                occupancy.see(x, y, pose[0, 2], ranges, deviation)
            assert not ((occupancy.evidence > 0) & ~maze.walls).any()
            assert not ((occupancy.evidence < 0) & maze.walls).any()
            num_seen += np.count_nonzero(occupancy.evidence)
        assert num_seen > 30 * 60

    def test_a_map_that_proved_wrong_is_believed_less(self):
        occupancy = Occupancy.of_map(np.full((4, 4), 0.1))
        occupancy.evidence[:2] = 12.0  # eight walls where the map shows none
        assert occupancy.probability()[3, 3] > 0.4
        occupancy.evidence[:2] = -12.0
        assert occupancy.probability()[3, 3] < 0.1


class TestCellMap:
    def test_errors_at_rooms_and_pillars_are_undone(self):
        rng = np.random.default_rng(1)
        walls = dfs_walls(13, rng)
        shown = walls.copy()
        shown[3, 5], shown[4, 6] = True, False  # a room as a wall, a pillar as free
        probability = wall_probability(shown)
        assert probability[3, 5] < 0.5
        assert probability[4, 6] > 0.5

    def test_doors_are_as_uncertain_as_they_are_shown(self):
        walls = dfs_walls(13, np.random.default_rng(1))
        doors = wall_probability(walls)[1:-1:2, 2:-1:2]
        assert set(np.unique(doors > 0.5)) == {False, True}
        assert 0.05 <= doors.min() < doors.max() <= 0.95

    def test_a_map_without_corridors_is_taken_cell_by_cell(self):
        walls = obstacles_walls(13, np.random.default_rng(1))
        inner = wall_probability(walls)[1:-1, 1:-1]
        np.testing.assert_array_equal(inner > 0.5, walls[1:-1, 1:-1])


def ring(size: int = 7) -> np.ndarray:
    """`[N, N]` float: certain walls but for a ring of free cells along the border."""
    walls = np.ones((size, size))
    walls[1:-1, 1:-1] = 0.0
    walls[2:-2, 2:-2] = 1.0
    return walls


def goal_at(*cells: tuple[int, int], size: int = 7) -> np.ndarray:
    goal = np.zeros((size, size))
    goal[tuple(np.transpose(cells))] = 1 / len(cells)
    return goal


class TestPlanning:
    def test_path_is_a_shortest_one(self):
        assert planning.plan(ring(), goal_at((1, 4)), (1, 1)) == [(1, 1), (1, 2), (1, 3), (1, 4)]

    def test_path_leads_around_a_corridor_that_is_blocked(self):
        walls = ring()
        walls[1, 3] = 1.0
        path = planning.plan(walls, goal_at((1, 4)), (1, 1))
        assert path[1] == (2, 1)
        assert len(path) == 1 + 13

    @pytest.mark.parametrize(("probability", "length"), [(0.1, 3), (0.5, 3), (0.95, 13)])
    def test_an_uncertain_cell_is_tried_where_the_detour_is_long(self, probability, length):
        walls = ring()
        walls[1, 3] = probability
        assert len(planning.plan(walls, goal_at((1, 4)), (1, 1))) == 1 + length

    def test_the_likeliest_goals_are_searched_first_and_near_ones_before_far_ones(self):
        goal = goal_at((1, 3), (1, 5))
        assert planning.plan(ring(), goal, (1, 1))[-1] == (1, 3)
        goal[1, 3] = 0.01
        assert planning.plan(ring(), goal, (1, 1))[-1] == (1, 5)


class TestDriving:
    def test_a_line_is_clear_if_the_body_fits(self):
        blocked = np.zeros((5, 5), dtype=bool)
        blocked[2, 2] = True  # from (2, 2) to (3, 3)
        assert driving.is_clear(blocked, 0.5, 3.3, 4.5, 3.3, 0.25)
        assert not driving.is_clear(blocked, 0.5, 3.2, 4.5, 3.2, 0.25)
        assert driving.is_clear(blocked, 1.0, 3.0, 2.0, 4.0, 0.25)

    def test_a_corner_is_cut_where_there_is_room(self):
        points = np.array([[0.5, 0.5], [1.5, 0.5], [2.5, 0.5], [2.5, 1.5], [2.5, 2.5]])
        free, walls = np.zeros((5, 5), dtype=bool), np.zeros((5, 5), dtype=bool)
        walls[3, 1] = True  # from (1, 1) to (2, 2), within the bend
        assert driving.aim(free, points, 0.5, 0.5) == (2.5, 2.5)
        x, y = driving.aim(walls, points, 0.5, 0.5)
        assert x > 2
        assert y < 1


def play(spec: TaskSpec, trials: list) -> list[Outcome]:
    """The outcomes of the navigator, in the order of the trials."""
    agent_class = load_agent_class("navigator")
    agent = agent_class.build(Interface(spec.task, spec.size, spec.context_size, sensors=spec.sensors))
    played = run_trials(agent, spec, list(enumerate(trials)), 64)
    return sorted((outcome for outcomes in played for outcome in outcomes), key=lambda outcome: outcome.index)


def success_rate(outcomes: list[Outcome]) -> float:
    return float(np.mean([outcome.success for outcome in outcomes]))


def track_success_rate(track: str, level: int, distances: tuple[int, ...], num_mazes: int = 10) -> float:
    mazes = TRACKS[track].mazes((level,), "train")[:num_mazes]
    spec = make_spec(track, maps=mazes, level=level, distances=distances)
    return success_rate(play(spec, draw_trials(spec, 2)))


class TestNavigator:
    def test_lidar_is_needed(self):
        with pytest.raises(InputError, match=r"^navigator needs the sensor lidar; give the interface sensors="):
            load_agent_class("navigator").build(Interface("local", 13, 13))

    def test_goals_are_reached_where_the_map_is_true(self):
        mazes = load_mazes(13, "train")[:4]
        distances = tuple(range(1, 16))
        spec = make_spec(maps=mazes, distances=distances, sensors=("lidar",), time_limit=100)
        assert success_rate(play(spec, draw_trials(spec, 2))) == 1.0

    @pytest.mark.parametrize("level", [1, 2, 3])
    def test_goals_are_reached_where_doors_have_moved(self, level):
        assert track_success_rate("stale", level, (5, 10, 15, 20)) >= 0.95

    @pytest.mark.parametrize("level", [1, 2, 3])
    def test_goals_are_reached_where_the_pose_is_odometry(self, level):
        assert track_success_rate("lost", level, (5, 10, 15, 20)) >= 0.95

    def test_goals_are_reached_that_are_far(self):
        assert track_success_rate("far", 1, (25, 35), num_mazes=5) == 1.0

    def test_a_landmark_in_a_wall_is_given_up(self):
        # Landmarks are planned on the shown map, and some of them lie in walls. The legs to them time out.
        mazes = load_mazes(13, "train")[:20]
        spec = make_spec("hierarchical", maps=mazes, map_flip=0.1, sensors=("lidar",), time_limit=100)
        assert success_rate(play(spec, draw_trials(spec))) >= 0.9

    @pytest.mark.parametrize("perturbation", [{"position_noise": 0.5}, {"map_warp": 0.1}], ids=["noise", "warp"])
    def test_goals_are_reached_where_positions_or_marks_are_off(self, perturbation):
        mazes = load_mazes(13, "train")[:5]
        spec = make_spec(maps=mazes, distances=(5, 10), sensors=("lidar",), time_limit=100, **perturbation)
        assert success_rate(play(spec, draw_trials(spec, 2))) >= 0.9

    def test_the_cells_of_a_mark_on_a_small_map_are_searched(self):
        # 5 x 5 pixels of a field of 15 x 15 cells: nine cells have the goal's pixel.
        maze = field(15)
        spec = make_spec(maps=maze, distances=(12,), context_size=5, sensors=("lidar",), time_limit=100)
        rng = np.random.default_rng(0)
        trials = [make_trial(maze, 0, ((2, 2), goal), rng) for goal in ((9, 6), (11, 8), (10, 7))]
        assert success_rate(play(spec, trials)) == 1.0
