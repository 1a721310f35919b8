"""Flipped and warped maps: what stays, how much changes, and homographies one can do by hand."""

from __future__ import annotations

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies

from mazebench.errors import InputError
from mazebench.maps.generators import corner_cells, generate
from mazebench.maps.maze import cell_to_point, point_to_cell
from mazebench.maps.perturb import MAX_WARP, flip, random_homography, warp_cell, warp_points, warp_walls


@pytest.fixture(scope="module")
def maze():
    return generate("dfs", 21, np.random.default_rng(0))


def moved(walls: np.ndarray, right: int, down: int) -> np.ndarray:
    """`walls` shifted by whole cells, with walls coming in from outside."""
    size = len(walls)
    padded = np.pad(walls, size, constant_values=True)
    return padded[size - down : 2 * size - down, size - right : 2 * size - right]


class TestFlip:
    @pytest.mark.parametrize("probability", [0.3, 1.0])
    def test_flip_when_border_start_and_goal_are_kept(self, maze, probability):
        start, goal = corner_cells(maze)
        kept = np.zeros_like(maze.walls)
        kept[[0, -1]] = kept[:, [0, -1]] = kept[start] = kept[goal] = True
        for seed in range(20):
            flipped = flip(maze.walls, probability, [start, goal], np.random.default_rng(seed))
            np.testing.assert_array_equal(flipped[kept], maze.walls[kept])
            if probability == 1:
                np.testing.assert_array_equal(flipped[~kept], ~maze.walls[~kept])

    def test_flip_when_probability_is_0(self, maze):
        flipped = flip(maze.walls, 0.0, [], np.random.default_rng(0))
        np.testing.assert_array_equal(flipped, maze.walls)
        assert not np.shares_memory(flipped, maze.walls)

    @pytest.mark.parametrize("probability", [0.1, 0.5])
    def test_flip_when_counted(self, maze, probability):
        rng = np.random.default_rng(0)
        flips = np.mean([flip(maze.walls, probability, [], rng) ^ maze.walls for _ in range(1000)], axis=0)
        inner = flips[1:-1, 1:-1]
        deviation = np.sqrt(probability * (1 - probability) / 1000)
        assert abs(inner.mean() - probability) < 4 * deviation / np.sqrt(inner.size)
        # Walls and free cells alike, wherever they are: of 361 cells none is 5 standard deviations off.
        assert np.abs(inner - probability).max() < 5 * deviation

    def test_flip_when_seed_is_the_same(self, maze):
        first, again, other = (flip(maze.walls, 0.2, [], np.random.default_rng(seed)) for seed in (1, 1, 2))
        np.testing.assert_array_equal(first, again)
        assert (first != other).any()


class TestWarp:
    def test_warp_when_share_is_0(self, maze):
        homography = random_homography(maze.size, 0.0, np.random.default_rng(0))
        np.testing.assert_allclose(homography, np.eye(3), atol=1e-9)
        np.testing.assert_array_equal(warp_walls(maze.walls, homography), maze.walls)
        for cell in [(0, 0), (3, 17), (20, 20)]:
            assert warp_cell(cell, homography, maze.size) == cell

    @pytest.mark.parametrize(("right", "down"), [(1, 0), (0, 1), (-3, 2), (5, -7)])
    def test_warp_when_shifted_by_whole_cells(self, maze, right, down):
        shift = np.array([[1.0, 0, right], [0, 1, down], [0, 0, 1]])
        np.testing.assert_array_equal(warp_walls(maze.walls, shift), moved(maze.walls, right, down))
        assert warp_cell((10, 10), shift, maze.size) == (10 + down, 10 + right)

    def test_warp_when_stretched_threefold(self, maze):
        # About the map's top left corner: each cell becomes a block of 3 x 3 cells, the middle one its centre.
        stretch = np.diag([3.0, 3.0, 1.0])
        expected = maze.walls[:7, :7].repeat(3, axis=0).repeat(3, axis=1)
        np.testing.assert_array_equal(warp_walls(maze.walls, stretch), expected)
        assert warp_cell((2, 5), stretch, maze.size) == (7, 16)

    def test_warp_when_shrunk_threefold(self, maze):
        # The centre of each shown cell is the centre of the middle one of 3 x 3 cells; beyond the map is wall.
        shrink = np.diag([1 / 3, 1 / 3, 1.0])
        expected = np.ones_like(maze.walls)
        expected[:7, :7] = maze.walls[1::3, 1::3]
        np.testing.assert_array_equal(warp_walls(maze.walls, shrink), expected)
        assert warp_cell((7, 16), shrink, maze.size) == (2, 5)

    def test_warp_when_mirrored(self, maze):
        mirror = np.array([[-1.0, 0, maze.size], [0, 1, 0], [0, 0, 1]])
        np.testing.assert_array_equal(warp_walls(maze.walls, mirror), maze.walls[:, ::-1])
        assert warp_cell((4, 1), mirror, maze.size) == (4, 19)

    def test_warp_when_perspective_divides(self):
        # (x, y) goes to (x, y) / (1 + x / 4).
        perspective = np.array([[1.0, 0, 0], [0, 1, 0], [0.25, 0, 1]])
        assert warp_cell((0, 1), perspective, 5) == (0, 1)  # (1.5, 0.5) / 1.375 = (1.09, 0.36)
        assert warp_cell((4, 4), perspective, 5) == (2, 2)  # (4.5, 4.5) / 2.125 = (2.12, 2.12)

    def test_warp_points_when_compared_with_cells(self):
        homography = random_homography(21, 0.2, np.random.default_rng(0))
        cells = [(row, column) for row in range(5, 16) for column in range(5, 16)]
        points = warp_points(cell_to_point(np.array(cells), 21), homography, 21)
        expected = [warp_cell(cell, homography, 21) for cell in cells]
        np.testing.assert_array_equal(np.clip(point_to_cell(points, 21), 0, 20), expected)

    def test_warp_cell_when_it_leaves_the_map(self):
        shift = np.array([[1.0, 0, 3], [0, 1, -4], [0, 0, 1]])
        assert warp_cell((2, 3), shift, 5) == (0, 4)

    @hypothesis.settings(max_examples=60, deadline=None)
    @hypothesis.given(strategies.floats(0, MAX_WARP), strategies.integers(0, 2**32 - 1))
    def test_homography_when_corners_are_moved(self, share, seed):
        size = 13
        homography = random_homography(size, share, np.random.default_rng(seed))
        corners = np.array([[0, 0], [size, 0], [size, size], [0, size]])
        images = np.c_[corners, np.ones(4)] @ homography.T
        shifts = images[:, :2] / images[:, 2:] - corners
        assert np.abs(shifts).max() <= share * size + 1e-4
        # Convex, so that no point of the map lies at or beyond the horizon.
        assert (images[:, 2] > 0).all()

    def test_homography_when_corners_are_counted(self):
        rng = np.random.default_rng(0)
        homographies = np.array([random_homography(10, 0.2, rng) for _ in range(2000)])
        top_left = homographies[:, :2, 2]  # the image of (0, 0), for the last entry is 1
        # Uniform from -2 to 2 in x and in y, independently.
        np.testing.assert_allclose(top_left.mean(axis=0), 0, atol=4 * 2 / np.sqrt(3 * 2000))
        np.testing.assert_allclose(top_left.var(axis=0), 4 / 3, rtol=0.1)
        assert abs(np.corrcoef(top_left.T)[0, 1]) < 0.1

    def test_warped_cell_when_compared_with_warped_walls(self, maze):
        # A wall block of 3 x 3 cells is found where its middle is said to lie, whatever the transform.
        for seed in range(50):
            rng = np.random.default_rng(seed)
            homography = random_homography(maze.size, 0.1, rng)
            row, column = (int(index) for index in rng.integers(5, 16, size=2))
            walls = np.zeros_like(maze.walls)
            walls[row - 1 : row + 2, column - 1 : column + 2] = True
            assert warp_walls(walls, homography)[warp_cell((row, column), homography, maze.size)]

    @pytest.mark.parametrize("share", [-0.01, 0.26, 1.0, float("nan"), float("inf")])
    def test_share_when_out_of_range(self, share):
        with pytest.raises(InputError, match=rf"^expected a map warp from 0 to 0\.25, found {share}$"):
            random_homography(13, share, np.random.default_rng(0))
