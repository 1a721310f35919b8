"""Maps seen through homographies that can be computed by hand."""

from __future__ import annotations

import numpy as np
import pytest

from mazebench.maps.homography import warp_cell, warp_points, warp_walls
from mazebench.maps.kinds import generate
from mazebench.maps.maze import cell_to_point, point_to_cell
from mazebench.tasks.perturbations.flip_warp_noise import random_homography


@pytest.fixture(scope="module")
def maze():
    return generate("dfs", 21, np.random.default_rng(0))


def moved(walls: np.ndarray, right: int, down: int) -> np.ndarray:
    """`walls` shifted by whole cells, with walls coming in from outside."""
    size = len(walls)
    padded = np.pad(walls, size, constant_values=True)
    return padded[size - down : 2 * size - down, size - right : 2 * size - right]


class TestWarp:
    def test_a_share_of_0_changes_nothing(self, maze):
        homography = random_homography(maze.size, 0.0, np.random.default_rng(0))
        np.testing.assert_allclose(homography, np.eye(3), atol=1e-9)
        np.testing.assert_array_equal(warp_walls(maze.walls, homography), maze.walls)
        for cell in [(0, 0), (3, 17), (20, 20)]:
            assert warp_cell(cell, homography, maze.size) == cell

    @pytest.mark.parametrize(("right", "down"), [(1, 0), (0, 1), (-3, 2), (5, -7)])
    def test_a_shift_moves_whole_cells(self, maze, right, down):
        shift = np.array([[1.0, 0, right], [0, 1, down], [0, 0, 1]])
        np.testing.assert_array_equal(warp_walls(maze.walls, shift), moved(maze.walls, right, down))
        assert warp_cell((10, 10), shift, maze.size) == (10 + down, 10 + right)

    def test_a_perspective_divides(self):
        # (x, y) goes to (x, y) / (1 + x / 4).
        perspective = np.array([[1.0, 0, 0], [0, 1, 0], [0.25, 0, 1]])
        assert warp_cell((0, 1), perspective, 5) == (0, 1)  # (1.5, 0.5) / 1.375 = (1.09, 0.36)
        assert warp_cell((4, 4), perspective, 5) == (2, 2)  # (4.5, 4.5) / 2.125 = (2.12, 2.12)

    def test_points_move_with_their_cells(self):
        homography = random_homography(21, 0.2, np.random.default_rng(0))
        cells = [(row, column) for row in range(5, 16) for column in range(5, 16)]
        points = warp_points(cell_to_point(np.array(cells), 21), homography, 21)
        expected = [warp_cell(cell, homography, 21) for cell in cells]
        np.testing.assert_array_equal(np.clip(point_to_cell(points, 21), 0, 20), expected)

    def test_a_warped_cell_is_where_the_warped_walls_show_it(self, maze):
        # A wall block of 3 x 3 cells is found where its middle is said to lie, whatever the transform.
        for seed in range(50):
            rng = np.random.default_rng(seed)
            homography = random_homography(maze.size, 0.1, rng)
            row, column = (int(index) for index in rng.integers(5, 16, size=2))
            walls = np.zeros_like(maze.walls)
            walls[row - 1 : row + 2, column - 1 : column + 2] = True
            assert warp_walls(walls, homography)[warp_cell((row, column), homography, maze.size)]
