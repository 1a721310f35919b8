"""The navigator's localization: what scans tell, and beliefs along drives whose true poses are known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from mazebench_agents.navigator import localization, scans
from mazebench_agents.navigator.exploration import disambiguate

from mazebench.maps.generators import dfs_walls
from mazebench.maps.maze import Maze, cell_to_point, point_to_cell
from mazebench.tasks.tracks.lost import Odometry, corrupted_odometry
from mazebench.world.angles import wrap_angle
from mazebench.world.lidar import Lidar

SIZE = 13


def dfs_maze(seed):
    return Maze(dfs_walls(SIZE, np.random.default_rng(seed)))


def corridor_with_niche():
    """A corridor, equal from both sides but for a niche at its right end, which is out of sight from the middle."""
    walls = np.ones((SIZE, SIZE), dtype=bool)
    walls[6, 1:12] = False
    walls[5, 11] = False
    return Maze(walls)


def random_poses(maze, num_poses, rng):
    cells = maze.free_cells[rng.integers(len(maze.free_cells), size=num_poses)]
    points = cell_to_point(cells, maze.size) + rng.uniform(-0.34, 0.34, size=(num_poses, 2))
    return np.column_stack([points, rng.uniform(-math.pi, math.pi, size=num_poses)])


def scans_at(maze, poses):
    """What the sensor observes."""
    return Lidar([maze]).ranges(np.zeros(len(poses), dtype=np.int64), np.array(poses, dtype=np.float64))


def odometry_along(poses, odometry):
    """What the track `lost` observes of x, y and yaw."""
    readings = []
    for x, y, yaw in poses:
        state = np.zeros(12)
        state[[0, 1, 5]] = x, y, wrap_angle(yaw)
        odometry(state)
        readings.append(state[[0, 1, 5]])
    return readings


def tour(maze, num_steps, rng):
    """Poses of a body that drives from cell to cell, turns as it likes, and does not turn back where it needn't."""
    before, cell = None, tuple(maze.free_cells[rng.integers(len(maze.free_cells))])
    poses, yaw = [(*cell_to_point(cell, maze.size), rng.uniform(-math.pi, math.pi))], None
    while len(poses) < num_steps:
        neighbours = [tuple(np.add(cell, step)) for step in ((0, 1), (1, 0), (0, -1), (-1, 0))]
        free = [other for other in neighbours if maze.is_free(other)]
        ahead = [other for other in free if other != before] or free
        before, cell = cell, ahead[rng.integers(len(ahead))]
        start, end = np.array(poses[-1][:2]), cell_to_point(cell, maze.size)
        for share in (1 / 3, 2 / 3, 1.0):
            yaw = poses[-1][2] + rng.normal(0.0, 0.2)
            poses.append((*(start + share * (end - start)), yaw))
    return np.array(poses[:num_steps])


def uniform(maze):
    return (~maze.walls) / len(maze.free_cells)


def only(cell, size=SIZE):
    distribution = np.zeros((size, size))
    distribution[tuple(cell)] = 1.0
    return distribution


def beliefs_along(maze, poses, distribution, odometry=None, walls=None, goal=None):
    """The beliefs of a body that is at `poses` one after the other, and has the map `walls`."""
    walls = maze.walls if walls is None else walls
    readings = odometry_along(poses, odometry or Odometry(np.random.default_rng(0)))
    belief, found = None, []
    for reading, ranges in zip(readings, scans_at(maze, poses), strict=True):
        if belief is None:
            belief = localization.begin(walls, distribution, reading, ranges, goal)
        else:
            belief = localization.update(belief, walls, reading, ranges, goal)
        found.append(belief)
    return found


def is_right(belief, pose):
    return math.dist(belief.pose[:2], pose[:2]) < 0.3 and abs(wrap_angle(belief.pose[2] - pose[2])) < math.radians(10)


class TestScans:
    @pytest.mark.parametrize("seed", range(3))
    def test_expected_scans_equal_the_sensors(self, seed):
        maze = dfs_maze(seed)
        poses = random_poses(maze, 100, np.random.default_rng(seed))
        np.testing.assert_allclose(scans.predict(maze.walls, poses), scans_at(maze, poses), atol=1e-5)

    def test_one_scan_tells_heading_and_position_up_to_quarter_turns_and_cells(self):
        maze = dfs_maze(3)
        rng = np.random.default_rng(3)
        poses = random_poses(maze, 600, rng)
        poses[300:, 2] = math.pi / 4 + rng.normal(0.0, 1e-4, size=300)  # where the quarter turns change
        for (x, y, yaw), ranges in zip(poses, scans_at(maze, poses), strict=True):
            heading, within_x, within_y = scans.wall_frame(ranges.astype(np.float64))
            turns = round((yaw - heading) / (math.pi / 2))
            assert abs(yaw - heading - turns * math.pi / 2) < 1e-3
            # The frame's position, turned into the map's frame, differs from the true one by whole cells.
            offset = complex(within_x, within_y) * 1j**turns - complex(x, y)
            apart = [abs(value - round(value)) for value in (offset.real, offset.imag) if not math.isnan(value)]
            assert max(apart, default=0.0) < 5e-3

    def test_a_direction_in_which_no_wall_is_seen_is_unknown(self):
        walls = np.ones((SIZE, SIZE), dtype=bool)
        walls[6, 1:12] = False
        ranges = scans_at(Maze(walls), [(6.3, 6.6, 0.1)])[0].astype(np.float64)
        heading, within_x, within_y = scans.wall_frame(ranges)
        assert heading == pytest.approx(0.1, abs=1e-4)
        assert math.isnan(within_x)
        assert within_y == pytest.approx(0.6, abs=1e-4)


class TestLocalization:
    def test_a_known_start_in_a_place_without_symmetry_is_settled_at_once(self):
        maze = corridor_with_niche()
        pose = (10.5, 6.5, 0.7)
        (belief,) = beliefs_along(maze, [pose], only((6, 10)))
        np.testing.assert_allclose(belief.pose, pose, atol=1e-3)
        assert belief.confidence > 0.999
        assert belief.explained == 1.0

    def test_equal_views_stay_equally_likely_until_a_telling_one(self):
        maze = corridor_with_niche()
        poses = [(x, 6.5, 0.0) for x in np.arange(6.5, 10.0, 0.4)]
        beliefs = beliefs_along(maze, poses, only((6, 6)))
        np.testing.assert_allclose(beliefs[0].weights[:2], [0.5, 0.5], atol=1e-6)
        np.testing.assert_allclose(sorted(abs(beliefs[0].poses[:2, 2])), [0.0, math.pi], atol=1e-3)
        assert beliefs[-1].confidence > 0.99
        assert is_right(beliefs[-1], poses[-1])

    def test_the_likeliest_pose_stays_with_one_hypothesis_while_views_are_equal(self):
        poses = [(6.5 + 0.1 * math.sin(step), 6.5, 0.0) for step in range(20)]
        beliefs = beliefs_along(corridor_with_niche(), poses, only((6, 6)))
        assert len({round(float(belief.pose[2]), 2) for belief in beliefs}) == 1

    @pytest.mark.parametrize("seed", range(5))
    def test_an_unknown_start_is_found(self, seed):
        maze = dfs_maze(seed)
        poses = tour(maze, 60, np.random.default_rng(seed))
        beliefs = beliefs_along(maze, poses, uniform(maze))
        assert is_right(beliefs[-1], poses[-1])
        assert beliefs[-1].confidence > 0.99
        assert not [
            1
            for belief, pose in zip(beliefs, poses, strict=True)
            if belief.confidence > 0.95 and not is_right(belief, pose)
        ]

    @pytest.mark.parametrize("seed", range(5))
    def test_a_long_drive_with_corrupted_odometry_does_not_drift(self, seed):
        rng = np.random.default_rng(seed)
        maze = dfs_maze(seed)
        poses = tour(maze, 1000, rng)
        odometry = corrupted_odometry(rng)
        beliefs = beliefs_along(maze, poses, uniform(maze), odometry)
        assert all(is_right(belief, pose) for belief, pose in zip(beliefs[60:], poses[60:], strict=True))
        assert beliefs[-1].moved / beliefs[-1].driven == pytest.approx(1 / odometry.scale, abs=0.01)

    def test_the_goal_cell_is_ruled_out_where_the_episode_goes_on(self):
        poses = [(x, 6.5, 0.0) for x in (6.5, 6.9, 7.3, 7.5, 7.5)]
        # The other hypothesis is then in the mirrored cell, with the same view.
        goal = tuple(point_to_cell((5.5, 6.5), SIZE))
        without, with_goal = (
            beliefs_along(corridor_with_niche(), poses, only((6, 6)), goal=cell)[-1] for cell in (None, goal)
        )
        assert without.confidence == pytest.approx(0.5, abs=1e-6)
        assert with_goal.confidence > 0.999
        assert is_right(with_goal, poses[-1])

    def test_a_body_that_was_carried_away_is_found_again(self):
        maze = dfs_maze(1)
        rng = np.random.default_rng(1)
        before, after = tour(maze, 60, rng), tour(maze, 60, rng)
        readings = odometry_along(before, Odometry(rng)) + odometry_along(after, Odometry(rng))
        belief = None
        for reading, ranges in zip(readings, scans_at(maze, [*before, *after]), strict=True):
            if belief is None:
                belief = localization.begin(maze.walls, uniform(maze), reading, ranges)
            else:
                belief = localization.update(belief, maze.walls, reading, ranges)
        assert is_right(belief, after[-1])

    @pytest.mark.parametrize("seed", range(5))
    def test_moved_doors_do_not_mislead_a_pose_that_is_known(self, seed):
        rng = np.random.default_rng(seed)
        maze = dfs_maze(seed)
        poses = tour(maze, 200, rng)
        settled = beliefs_along(maze, poses, uniform(maze))[60]
        walls = with_moved_doors(maze.walls, 3, rng)
        readings = odometry_along(poses, Odometry(rng))
        belief = settled
        for reading, ranges, pose in zip(readings[61:], scans_at(maze, poses)[61:], poses[61:], strict=True):
            belief = localization.update(belief, walls, reading, ranges)
            assert is_right(belief, pose)

    def test_a_body_that_no_scan_explains_keeps_its_pose_where_the_map_has_no_other_free_cell(self):
        maze, walls = dfs_maze(0), np.ones((SIZE, SIZE), dtype=bool)
        (ranges,) = scans_at(maze, [(*cell_to_point(maze.free_cells[0], SIZE), 0.3)])
        assert not np.isnan(scans.wall_frame(ranges)).any()
        belief = localization.begin(walls, only((6, 6)), np.zeros(3), ranges, heading=0.3)
        for _ in range(6):
            belief = localization.update(belief, walls, np.zeros(3), ranges)
        assert belief.weights.tolist() == [1.0]

    def test_beliefs_of_several_bodies_are_independent(self):
        mazes = [dfs_maze(seed) for seed in range(2)]
        tours = [tour(maze, 30, np.random.default_rng(seed)) for seed, maze in enumerate(mazes)]
        alone = [beliefs_along(maze, poses, uniform(maze)) for maze, poses in zip(mazes, tours, strict=True)]
        again = [
            beliefs_along(maze, poses, uniform(maze)) for maze, poses in zip(mazes[::-1], tours[::-1], strict=True)
        ]
        for first, second in zip(alone, again[::-1], strict=True):
            for one, other in zip(first, second, strict=True):
                np.testing.assert_array_equal(one.poses, other.poses)
                np.testing.assert_array_equal(one.weights, other.weights)

    def test_an_update_leaves_its_arguments_as_they_were(self):
        maze = dfs_maze(0)
        poses = tour(maze, 2, np.random.default_rng(0))
        first, _ = beliefs_along(maze, poses, uniform(maze))
        kept = [np.copy(value) for value in first]
        localization.update(first, maze.walls, np.zeros(3), scans_at(maze, poses[1:])[0])
        for value, copy in zip(first, kept, strict=True):
            np.testing.assert_array_equal(value, copy)


def with_moved_doors(walls, num_doors, rng):
    """Opens some closed doors between two rooms and closes as many open ones, as in the track `stale`."""
    rows, columns = np.indices(walls.shape)
    inside = (rows % (SIZE - 1) > 0) & (columns % (SIZE - 1) > 0)
    doors = inside & ((rows + columns) % 2 == 1)
    moved = walls.copy()
    for is_closed in (True, False):
        cells = np.argwhere(doors & (walls == is_closed))
        moved[tuple(rng.permutation(cells)[:num_doors].T)] = not is_closed
    return moved


class TestDisambiguate:
    def test_it_leads_to_where_the_views_of_the_hypotheses_differ(self):
        maze = corridor_with_niche()
        (belief,) = beliefs_along(maze, [(6.5, 6.5, 0.0)], only((6, 6)))
        path = disambiguate(belief, maze.walls)
        points = cell_to_point(path, SIZE)
        mirrored = np.array([SIZE, SIZE]) - points[-1]
        yaw = belief.pose[2]
        seen = scans.predict(maze.walls, np.array([(*points[-1], yaw), (*mirrored, yaw + math.pi)]))
        assert path[0] == (6, 6)
        assert np.abs(np.diff(path, axis=0)).sum(axis=1).tolist() == [1] * (len(path) - 1)
        assert np.abs(seen[0] - seen[1]).max() > 0.3

    @pytest.mark.parametrize("x", [0.5, -3.0, 12.5, 20.0])
    def test_cells_beyond_the_edge_of_the_map_are_no_way(self, x):
        maze = corridor_with_niche()
        (belief,) = beliefs_along(maze, [(6.5, 6.5, 0.0)], only((6, 6)))
        belief.poses[0, :2] = x, 6.5
        assert set(disambiguate(belief, maze.walls)[1:]) <= set(map(tuple, maze.free_cells.tolist()))

    def test_a_known_pose_needs_no_way(self):
        maze = corridor_with_niche()
        (belief,) = beliefs_along(maze, [(10.5, 6.5, 0.7)], only((6, 10)))
        assert disambiguate(belief, maze.walls) == [(6, 10)]
