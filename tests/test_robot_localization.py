"""The robot's estimates: the beam model, the occupancy grid, the pose on it, and where the map lies."""

from __future__ import annotations

import math

import numpy as np
import pytest
from mazebench_agents.robot import beams
from mazebench_agents.robot.map_matching import MapBelief, orientations
from mazebench_agents.robot.occupancy import SURE, posterior, seen_walls
from mazebench_agents.robot.tracking import Tracker, aligned

from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze, cell_to_point
from mazebench.tasks.perturbations.odometry import NoisyMotion, Odometry
from mazebench.tasks.sensors.lidar import read
from mazebench.world.angles import wrap_angle
from mazebench.world.ray_casting import TURTLEBOT3, Lidar, LidarModel

EXACT = beams.beams_of(LidarModel(), 1.0)
FREE, WALL = -1, 1
TURN = math.radians(21.12)  # of a look action


def scan(maze: Maze, pose: np.ndarray, model: LidarModel, rng: np.random.Generator) -> np.ndarray:
    return read(Lidar((maze,), model.max_range).ranges(np.zeros(1, int), pose[None]), model, [rng])[0].astype(float)


def poses_in(maze: Maze, count: int, rng: np.random.Generator) -> np.ndarray:
    cells = maze.free_cells[rng.integers(len(maze.free_cells), size=count)]
    points = cell_to_point(cells, maze.size) + rng.uniform(-0.34, 0.34, size=(count, 2))
    return np.column_stack([points, rng.uniform(-math.pi, math.pi, count)])


def tour(maze: Maze, num_cells: int, rng: np.random.Generator) -> np.ndarray:
    """Poses of a body that drives from cell to cell, begins in the middle of one, and turns on the way."""
    before, cell = None, tuple(maze.free_cells[rng.integers(len(maze.free_cells))].tolist())
    poses = [np.array([*cell_to_point(cell, maze.size), rng.uniform(-math.pi, math.pi)])]
    for _ in range(num_cells):
        row, column = cell
        free = [
            each
            for each in ((row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1))
            if maze.is_free(each)
        ]
        ahead = [each for each in free if each != before] or free
        before, cell = cell, ahead[rng.integers(len(ahead))]
        end = cell_to_point(cell, maze.size)
        for share in (0.5, 1.0):
            turn = rng.choice([0.0, 0.0, TURN, -TURN])
            poses.append(np.array([*(poses[-1][:2] + share * (end - poses[-1][:2])), poses[-1][2] + turn]))
    return np.array(poses)


class TestBeams:
    def test_likelihood_of_a_ray_by_hand(self):
        # One ray to the right: a cell that may be a wall, 0.5 away, and then a wall, 1.5 away.
        walls = np.zeros((3, 4))
        walls[1, 2:] = 0.3, 1.0
        model = beams.Beams(reach=5.0, sigma=0.1, lost=0.1, random=0.2)
        floor, peak = 0.2 / 5, 0.7 / (0.1 * math.sqrt(2 * math.pi))
        for reading, expected in ((0.5, floor + 0.3 * peak), (1.5, floor + 0.7 * peak), (1.0, floor), (5.0, 0.1)):
            found = beams.log_likelihoods(walls, np.array([[1.5, 1.5, 0.0]]), np.array([reading]), model, 0.0)
            assert math.exp(found[0]) == pytest.approx(expected, rel=1e-6)

    @pytest.mark.parametrize("kind", ["dfs", "house"])
    def test_the_true_pose_is_the_likeliest_one(self, kind):
        rng = np.random.default_rng(0)
        maze = Maze(generate(kind, 13, rng).walls)
        for pose in poses_in(maze, 20, rng):
            others = pose + rng.normal(0, 1, size=(50, 3)) * [0.3, 0.3, 0.2]
            ranges = scan(maze, pose, LidarModel(), rng)
            found = beams.log_likelihoods(maze.walls.astype(float), np.array([pose, *others]), ranges, EXACT, 0.02)
            assert found.argmax() == 0


def seen(pose: tuple[float, float, float], ranges: list[float], size: int, lost: float = 0.0) -> np.ndarray:
    """`[N, N]` float: the evidence of a scan."""
    evidence = np.zeros((size, size))
    beams.add_scan(evidence, *pose, np.array(ranges), beams.beams_of(LidarModel(lost=lost), 1.0), 0.01)
    return evidence


class TestOccupancy:
    def test_a_ray_clears_the_cells_it_crosses_and_marks_the_wall_at_its_end(self):
        # From the middle of cell (2, 1) to the right: cells (2, 1) to (2, 3) are free, the wall begins at x = 4.
        expected = np.zeros((5, 6))[:, :5]
        expected[2, 1:4], expected[2, 4] = FREE, WALL
        np.testing.assert_array_equal(np.sign(seen((1.5, 2.5, 0.0), [2.5], 5)), expected)

    def test_a_ray_of_full_range_ends_at_no_wall_and_tells_less_the_more_rays_are_lost(self):
        sure, doubtful = (seen((1.5, 4.5, 0.0), [5.0], 9, lost)[4, 3] for lost in (0.0, 0.3))
        assert sure < doubtful < 0

    def test_a_ray_into_a_corner_marks_no_wall(self):
        # From (1.5, 1.5) along the diagonal to the corner (3, 3), where three cells meet that may all be walls.
        assert (seen((1.5, 1.5, np.pi / 4), [1.5 * np.sqrt(2)], 5) > 0).sum() == 0

    @pytest.mark.parametrize("kind", ["dfs", "house"])
    @pytest.mark.parametrize("model", [LidarModel(), LidarModel(sigma=0.1, lost=0.1)], ids=str)
    def test_what_was_seen_is_true(self, kind, model):
        rng = np.random.default_rng(0)
        num_seen = num_wrong = 0
        for _ in range(5):
            maze = Maze(generate(kind, 13, rng).walls)
            evidence = np.zeros((13, 13))
            for pose in poses_in(maze, 40, rng):
                beams.add_scan(evidence, *pose, scan(maze, pose, model, rng), beams.beams_of(model, 1.0), 0.01)
            is_seen = np.abs(evidence) >= SURE
            num_seen += is_seen.sum()
            num_wrong += ((evidence > 0) != maze.walls)[is_seen].sum()
        assert num_seen > 5 * 80
        assert num_wrong <= 0.005 * num_seen

    def test_a_map_that_proved_wrong_is_believed_less(self):
        evidence, prior = np.zeros((4, 4)), np.full((4, 4), 0.1)
        evidence[:2] = 8.0  # eight walls where the map shows none
        assert posterior(prior, evidence)[3, 3] > 0.4
        evidence[:2] = -8.0
        assert posterior(prior, evidence)[3, 3] < 0.1


class TestTracking:
    @pytest.mark.parametrize("seed", range(2))
    def test_one_scan_tells_the_heading_up_to_quarter_turns(self, seed):
        rng = np.random.default_rng(seed)
        maze = Maze(generate("dfs", 13, rng).walls)
        for cell in maze.free_cells[rng.integers(len(maze.free_cells), size=10)]:
            pose = np.array([*cell_to_point(cell, 13), rng.uniform(-math.pi, math.pi)])
            ranges = scan(maze, pose, TURTLEBOT3, rng)
            found = aligned(25, ranges, beams.beams_of(TURTLEBOT3, 1.0))
            assert abs(math.remainder(found[2] - pose[2], math.pi / 2)) < math.radians(2)

    @pytest.mark.parametrize("kind", ["dfs", "house"])
    @pytest.mark.parametrize(("noise", "scale", "cells"), [(0.0, 1.0, 1), (0.2, 1.1, 1), (0.2, 1.1, 2)])
    def test_a_pose_is_followed_without_a_map(self, kind, noise, scale, cells):
        # A metre is so many cells, in which the tracker counts.
        rng = np.random.default_rng(0)
        maze, model = Maze(generate(kind, 31, rng).walls), beams.beams_of(TURTLEBOT3, cells)
        fine = Maze(np.kron(maze.walls, np.ones((cells, cells), dtype=bool)), cell_size=1 / cells)
        size, unit = 61 * cells, np.array([cells, cells, 1.0])
        errors = [NoisyMotion(noise, rng)] * (noise > 0) + [Odometry(rng, scale)]
        poses = tour(maze, 60, rng)
        evidence, tracker = np.zeros((size, size)), None
        for before, pose in zip([poses[0], *poses], poses, strict=False):
            state = np.zeros(12)
            state[[0, 1, 5]] = pose
            for error in errors:
                error(state)
            odometry, ranges = unit * state[[0, 1, 5]], cells * scan(fine, pose, TURTLEBOT3, rng)
            if tracker is None:
                tracker = Tracker(aligned(size, ranges, model), odometry, noise)
                turned = round((tracker.pose[2] - pose[2]) / (math.pi / 2)) * math.pi / 2
            else:
                # The command is followed up to an error, in the grid's frame.
                step = (complex(*pose[:2]) - complex(*before[:2])) * np.exp(1j * turned)
                x, y = tracker.pose[:2] + cells * (np.array([step.real, step.imag]) + rng.normal(0, 0.07, 2))
                commanded = np.array([x, y, tracker.pose[2] + pose[2] - before[2]])
                tracker.update(seen_walls(evidence), odometry, commanded, ranges, model)
            beams.add_scan(evidence, *tracker.pose, ranges, model, 0.03 * cells)
        way = (complex(*poses[-1][:2]) - complex(*poses[0][:2])) * np.exp(1j * turned)
        assert abs(complex(*tracker.pose[:2]) / cells - complex(30.5, 30.5) - way) < 0.15
        assert abs(wrap_angle(tracker.pose[2] - poses[-1][2] - turned)) < math.radians(5)


def only(cell: tuple[int, int], size: int) -> np.ndarray:
    plane = np.zeros((size, size))
    plane[cell] = 1.0
    return plane


class TestMapBelief:
    def evidence(self, walls: np.ndarray, cells: np.ndarray, turn: int, size: int) -> np.ndarray:
        """`[L, L]` float: what is seen of `cells` `[K, 2]`, with the first one in the middle of a turned grid."""
        known = np.zeros(walls.shape)
        known[tuple(cells.T)] = np.where(walls[tuple(cells.T)], 6.0, -6.0)
        grid = np.zeros((size, size))
        row, column = size // 2 - cells[0]
        grid[row : row + len(walls), column : column + len(walls)] = known
        return np.rot90(grid, turn)

    @pytest.mark.parametrize("num_turns", [4, 8])
    def test_a_place_is_found_by_what_was_seen_though_doors_moved(self, num_turns):
        for seed in range(10):
            rng = np.random.default_rng(seed)
            walls = generate("dfs", 31, rng).walls
            start = np.argwhere(~walls[10:20, 10:20])[0] + 10
            nearby = np.argwhere(np.abs(np.indices(walls.shape) - start[:, None, None]).max(axis=0) < 6)
            cells = np.array([start, *nearby])
            shown = walls ^ (rng.random(walls.shape) < 0.05)
            belief = MapBelief(shown.astype(float), only((1, 1), 31), num_turns, ~shown / (~shown).sum(), 61)
            turn = int(rng.integers(4))
            assert belief.update(self.evidence(walls, cells, turn, 61), only((30, 30), 61) > 0)
            best = belief.placements[belief.weights.argmax()]
            assert best[0] == turn
            assert belief.weights.max() > 0.99
            row, column = best[1:] + 30
            marked = orientations(only(tuple(start), 31), num_turns)[best[0]]
            assert marked[row, column] == 1.0

    def test_mixtures_weigh_maps_by_hypotheses(self):
        walls, goal = np.ones((5, 5)), only((1, 1), 5)
        walls[1:4, 1:4] = 0.0
        walls[1, 2] = 1.0
        belief = MapBelief(walls, goal, 4, None, 5)
        mixed, goals = belief.mixture()
        assert [mixed[cell] for cell in ((1, 2), (2, 1), (3, 2), (2, 3), (2, 2))] == [0.25] * 4 + [0.0]
        assert goals[1, 1] == goals[3, 3] == 0.25

    def test_a_goal_that_was_passed_counts_against_a_hypothesis(self):
        belief = MapBelief(np.full((5, 5), 0.5), only((1, 1), 5), 4, None, 5)
        assert belief.update(np.zeros((5, 5)), only((1, 1), 5) > 0)
        assert belief.weights[0] < 1e-3
