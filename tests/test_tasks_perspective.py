"""Maps seen through homographies that can be computed by hand."""

from __future__ import annotations

import numpy as np
import pytest

from mazebench.maps.kinds import generate
from mazebench.maps.maze import cell_to_point, point_to_cell
from mazebench.tasks.perturbations.flip_warp_noise import Perspective, random_homography


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
        np.testing.assert_array_equal(Perspective(homography).picture(maze.walls), maze.walls)
        for cell in [(0, 0), (3, 17), (20, 20)]:
            assert Perspective(homography).pixel(cell, maze.walls) == cell

    @pytest.mark.parametrize(("right", "down"), [(1, 0), (0, 1), (-3, 2), (5, -7)])
    def test_a_shift_moves_whole_cells(self, maze, right, down):
        shift = Perspective(np.array([[1.0, 0, right], [0, 1, down], [0, 0, 1]]))
        np.testing.assert_array_equal(shift.picture(maze.walls), moved(maze.walls, right, down))
        assert shift.pixel((10, 10), maze.walls) == (10 + down, 10 + right)

    def test_a_perspective_divides(self):
        # (x, y) goes to (x, y) / (1 + x / 4).
        perspective = Perspective(np.array([[1.0, 0, 0], [0, 1, 0], [0.25, 0, 1]]))
        picture = np.zeros((5, 5), bool)
        assert perspective.pixel((0, 1), picture) == (0, 1)  # (1.5, 0.5) / 1.375 = (1.09, 0.36)
        assert perspective.pixel((4, 4), picture) == (2, 2)  # (4.5, 4.5) / 2.125 = (2.12, 2.12)

    def test_points_move_with_their_cells(self):
        perspective = Perspective(random_homography(21, 0.2, np.random.default_rng(0)))
        cells = [(row, column) for row in range(5, 16) for column in range(5, 16)]
        points = perspective.points(cell_to_point(np.array(cells), 21), 21)
        expected = [perspective.pixel(cell, np.zeros((21, 21))) for cell in cells]
        np.testing.assert_array_equal(np.clip(point_to_cell(points, 21), 0, 20), expected)

    def test_a_warped_cell_is_where_the_warped_walls_show_it(self, maze):
        # A wall block of 3 x 3 cells is found where its middle is said to lie, whatever the transform.
        for seed in range(50):
            rng = np.random.default_rng(seed)
            perspective = Perspective(random_homography(maze.size, 0.1, rng))
            row, column = (int(index) for index in rng.integers(5, 16, size=2))
            walls = np.zeros_like(maze.walls)
            walls[row - 1 : row + 2, column - 1 : column + 2] = True
            picture = perspective.picture(walls)
            assert picture[perspective.pixel((row, column), picture)]
