"""Reading a map: which cells are walls, and which one is the goal, when the map's pixels are not the maze's cells."""

from __future__ import annotations

import numpy as np
import pytest
from mazebench_agents.robot.drawing import compare, widths_of_pixels
from mazebench_agents.robot.gauss_newton import inverse, normal_equations, variances
from mazebench_agents.robot.map_reading import read_map

from mazebench.maps.kinds import generate
from mazebench.tasks.context import START, build_context
from mazebench.tasks.episode import sample_pair
from mazebench.tasks.perturbations.hand_drawing import HandDrawnMap
from mazebench.tasks.perturbations.perturbation import ShownMap

SIZE = 13


def sketched(seed, level, kind="dfs"):
    """A maze, its start and goal, and the context of its map drawn by hand."""
    rng = np.random.default_rng(seed)
    maze = generate(kind, SIZE, rng)
    start, goal = sample_pair(maze, 8, rng)
    shown = HandDrawnMap(bend=level / 2).shown(ShownMap(maze.walls), ((1, 1), (1, 1)), rng)
    return maze, start, goal, build_context(shown.seen_walls, shown.seen_cell(start), shown.seen_cell(goal), 2 * SIZE)


def cross_entropy(probability, walls):
    """Nats a cell."""
    return float(-np.log(np.where(walls, probability, 1 - probability)[1:-1, 1:-1]).mean())


class TestDrawnMap:
    @pytest.mark.parametrize(
        ("level", "most_wrong", "most_surprise"), [(1, 0.01, 0.05), (2, 0.02, 0.15), (3, 0.12, 0.45)]
    )
    def test_most_goals_and_cells_are_read_right(self, level, most_wrong, most_surprise):
        found, wrong, surprise = [], [], []
        for seed in range(15):
            maze, _, goal, context = sketched(seed, level)
            reading = read_map(context, SIZE)
            found.append(np.unravel_index(reading.goal.argmax(), reading.goal.shape) == goal)
            wrong.append(((reading.walls > 0.5) != maze.walls).mean())
            surprise.append(cross_entropy(reading.walls, maze.walls))
        assert np.mean(found) >= 0.7
        assert np.mean(wrong) < most_wrong
        assert np.mean(surprise) < most_surprise

    def test_undistorted_drawing_is_read_right(self):
        maze, start, goal, _ = sketched(0, 1)
        picture = np.kron(maze.walls, np.ones((2, 2))).astype(np.float32)
        double = [(2 * row + 1, 2 * column + 1) for row, column in (start, goal)]
        reading = read_map(build_context(picture, *double, 2 * SIZE), SIZE)
        np.testing.assert_array_equal(reading.walls > 0.5, maze.walls)
        assert reading.goal[goal] > 0.9
        assert reading.start[start] > 0.9

    def test_map_without_a_start_mark_is_read(self):
        maze, _, _, context = sketched(3, 1)
        context[START] = 0
        reading = read_map(context, SIZE)
        np.testing.assert_array_equal(reading.walls > 0.5, maze.walls)
        assert reading.start.max() < 0.05

    @pytest.mark.parametrize("value", [0.0, 0.4, 1.0])
    def test_sheet_without_a_maze_gives_distributions(self, value):
        context = np.full((4, 2 * SIZE, 2 * SIZE), value, np.float32)
        for distribution in read_map(context, SIZE)[1:]:
            assert distribution.sum() == pytest.approx(1)
            assert distribution.min() >= 0


class TestCellMap:
    def test_cells_are_as_shown_up_to_errors_and_the_border_is_certain(self):
        maze = generate("house", 13, np.random.default_rng(0))
        reading = read_map(build_context(maze.walls, (1, 1), (1, 1), 13), 13)
        assert set(np.unique(reading.walls[1:-1, 1:-1])) == {0.1, 0.9}
        np.testing.assert_array_equal(reading.walls > 0.5, maze.walls)
        assert (reading.walls == 1).sum() == 4 * 12

    def test_planes_that_are_zero_tell_nothing(self):
        reading = read_map(np.zeros((4, 13, 13), np.float32), 13)
        assert np.unique(reading.walls[1:-1, 1:-1]).tolist() == [0.2]
        for distribution in (reading.start, reading.goal):
            np.testing.assert_allclose(distribution[1:-1, 1:-1], 1 / 11**2)


class TestCompare:
    @pytest.fixture
    def drawing(self):
        """Walls, points and box widths of a slightly rotated maze, with pixels of 0.6 cells."""
        rng = np.random.default_rng(0)
        walls = rng.random((SIZE, SIZE))
        walls[[0, -1]] = walls[:, [0, -1]] = 1.0
        grid = np.moveaxis(np.indices((20, 22)), 0, -1) * 0.6 + 0.3
        points = grid + 0.05 * grid[..., ::-1] * [1, -1]
        return walls, points, widths_of_pixels(points, 0.2)

    @pytest.mark.parametrize("thickening", [-0.3, 0.2])
    def test_slopes_are_derivatives_of_the_expectation(self, drawing, thickening):
        walls, points, widths = drawing
        blank, step = np.zeros(points.shape[:2]), 1e-7

        def expected(shift, change):
            return -compare(blank, points + shift, widths, thickening + change, walls, 0.1)[0]

        slopes = compare(blank, points, widths, thickening, walls, 0.1)[1]
        for index, (shift, change) in enumerate([((step, 0), 0), ((0, step), 0), ((0, 0), step)]):
            shift = np.array(shift)
            numerical = (expected(shift, change) - expected(-shift, -change)) / (2 * step)
            np.testing.assert_allclose(slopes[..., index], numerical, atol=1e-5)

    @pytest.mark.parametrize("thickening", [-0.3, 0.0, 0.2])
    def test_evidence_of_a_lone_doubtful_cell_is_the_ratio_of_likelihoods(self, drawing, thickening):
        walls, points, widths = drawing
        walls, cell, noise = np.round(walls), (5, 6), 0.1
        walls[cell] = 0.3
        picture = np.random.default_rng(1).random(points.shape[:2])
        evidence = compare(picture, points, widths, thickening, walls, noise)[3][cell]
        log_likelihoods = []
        for wall in (1.0, 0.0):
            walls[cell] = wall
            differences = compare(picture, points, widths, thickening, walls, noise)[0]
            log_likelihoods.append(-((differences / noise) ** 2).sum() / 2)
        assert evidence == pytest.approx(log_likelihoods[0] - log_likelihoods[1], abs=0.2)

    def test_pixels_show_the_share_of_wall_in_them(self):
        walls = np.zeros((SIZE, SIZE))
        walls[:, 6] = 1.0
        points = np.array([[[4.5, 6.25], [4.5, 7.0], [4.5, 7.2]]])
        for thickening, shares in ((0.0, [1, 0.5, 0.1]), (0.2, [1, 0.7, 0.3]), (-0.2, [0.8, 0.3, 0])):
            expected = -compare(np.zeros((1, 3)), points, np.full((1, 3, 2), 0.5), thickening, walls, 0.1)[0]
            np.testing.assert_allclose(expected[0], shares, atol=1e-12)


class TestGaussNewton:
    def test_sums_are_those_of_the_jacobian(self):
        rng = np.random.default_rng(0)
        basis, slopes = rng.normal(size=(2, 20, 3)), rng.normal(size=(4, 5, 3))
        differences, deviations = rng.normal(size=(4, 5)), rng.uniform(1, 2, size=(4, 5))
        weighted = slopes.reshape(-1, 3) / deviations.reshape(-1, 1)
        jacobian = np.hstack([basis[0] * weighted[:, :1], basis[1] * weighted[:, 1:2], weighted[:, 2:]])
        hessian, gradient = normal_equations(basis, slopes, differences, deviations)
        np.testing.assert_allclose(hessian, jacobian.T @ jacobian, atol=1e-12)
        np.testing.assert_allclose(gradient, jacobian.T @ (differences / deviations).ravel(), atol=1e-12)

    def test_inverse_is_that_of_lapack(self):
        factor = np.random.default_rng(0).normal(size=(40, 60))
        matrix = factor @ factor.T
        np.testing.assert_allclose(inverse(matrix), np.linalg.inv(matrix), rtol=1e-8, atol=1e-10)

    def test_variances_are_those_of_drawn_parameters(self):
        rng = np.random.default_rng(0)
        basis, factor = rng.normal(size=(2, 6, 3)), rng.normal(size=(7, 7))
        parameters = factor @ rng.normal(size=(7, 100_000))
        points = np.stack([basis[0] @ parameters[:3], basis[1] @ parameters[3:6]], axis=1)
        np.testing.assert_allclose(variances(basis, factor @ factor.T), points.var(axis=-1), rtol=0.05)
