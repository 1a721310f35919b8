"""Perturbations: what a flip keeps, how much changes, and where corners move."""

from __future__ import annotations

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies

from mazebench.maps.kinds import generate
from mazebench.maps.maze import corner_cells
from mazebench.tasks.perturbations.flip_warp_noise import MAX_WARP, MapFlip, random_homography
from mazebench.tasks.perturbations.perturbation import ShownMap


@pytest.fixture(scope="module")
def maze():
    return generate("dfs", 21, np.random.default_rng(0))


def flip(maze, probability, rng):
    return MapFlip(probability).shown(ShownMap(maze.walls), corner_cells(maze), rng).walls


class TestFlip:
    @pytest.mark.parametrize("probability", [0.3, 1.0])
    def test_border_start_and_goal_are_never_flipped(self, maze, probability):
        start, goal = corner_cells(maze)
        kept = np.zeros_like(maze.walls)
        kept[[0, -1]] = kept[:, [0, -1]] = kept[start] = kept[goal] = True
        for seed in range(20):
            flipped = flip(maze, probability, np.random.default_rng(seed))
            np.testing.assert_array_equal(flipped[kept], maze.walls[kept])
            if probability == 1:
                np.testing.assert_array_equal(flipped[~kept], ~maze.walls[~kept])

    @pytest.mark.parametrize("probability", [0.1, 0.5])
    def test_cells_are_flipped_with_the_probability_asked_for(self, maze, probability):
        rng = np.random.default_rng(0)
        flips = np.mean([flip(maze, probability, rng) ^ maze.walls for _ in range(1000)], axis=0)
        inner = flips[2:-2, 1:-1]  # without start and goal
        deviation = np.sqrt(probability * (1 - probability) / 1000)
        assert abs(inner.mean() - probability) < 4 * deviation / np.sqrt(inner.size)
        # Walls and free cells alike, wherever they are: of 323 cells none is 5 standard deviations off.
        assert np.abs(inner - probability).max() < 5 * deviation


class TestRandomHomography:
    @hypothesis.settings(max_examples=60, deadline=None)
    @hypothesis.given(strategies.floats(0, MAX_WARP), strategies.integers(0, 2**32 - 1))
    def test_no_corner_moves_farther_than_the_share(self, share, seed):
        size = 13
        homography = random_homography(size, share, np.random.default_rng(seed))
        corners = np.array([[0, 0], [size, 0], [size, size], [0, size]])
        images = np.c_[corners, np.ones(4)] @ homography.T
        shifts = images[:, :2] / images[:, 2:] - corners
        assert np.abs(shifts).max() <= share * size + 1e-4
        # Convex, so that no point of the map lies at or beyond the horizon.
        assert (images[:, 2] > 0).all()

    def test_corners_move_uniformly(self):
        rng = np.random.default_rng(0)
        homographies = np.array([random_homography(10, 0.2, rng) for _ in range(2000)])
        top_left = homographies[:, :2, 2]  # the image of (0, 0), for the last entry is 1
        # Uniform from -2 to 2 in x and in y, independently.
        np.testing.assert_allclose(top_left.mean(axis=0), 0, atol=4 * 2 / np.sqrt(3 * 2000))
        np.testing.assert_allclose(top_left.var(axis=0), 4 / 3, rtol=0.1)
        assert abs(np.corrcoef(top_left.T)[0, 1]) < 0.1
