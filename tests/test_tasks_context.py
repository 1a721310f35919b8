"""The four planes of the context, by hand on a 5 x 5 maze."""

from __future__ import annotations

import numpy as np
import pytest

from mazebench.maps.text import parse_maze
from mazebench.tasks.context import build_context, default_context_size

MAZE = parse_maze("#####\n#..##\n##..#\n#...#\n#####")
START, GOAL = (1, 1), (3, 3)
WALLS = [
    [1, 1, 1, 1, 1],
    [1, 0, 0, 1, 1],
    [1, 1, 0, 0, 1],
    [1, 0, 0, 0, 1],
    [1, 1, 1, 1, 1],
]


def context(context_size: int, start=START, goal=GOAL) -> np.ndarray:
    return build_context(MAZE.walls, start, goal, context_size)


def marks(plane: np.ndarray) -> list[tuple[int, int]]:
    assert set(np.unique(plane)) <= {0, 1}
    return [(int(row), int(column)) for row, column in np.argwhere(plane)]


class TestPlanes:
    def test_planes_when_context_has_the_size_of_the_maze(self):
        planes = context(5)
        assert planes.shape == (4, 5, 5)
        assert planes.dtype == np.float32
        np.testing.assert_array_equal(planes[0], WALLS)
        assert marks(planes[2]) == [GOAL]
        assert marks(planes[3]) == [START]

    def test_planes_when_start_is_goal(self):
        planes = context(5, goal=START)
        assert marks(planes[2]) == marks(planes[3]) == [START]

    def test_context_when_walls_are_left_alone(self):
        walls = MAZE.walls.copy()
        build_context(walls, START, GOAL, 5)[:] = 7
        np.testing.assert_array_equal(walls, WALLS)


class TestLocalMap:
    def test_crop_when_start_is_in_the_top_left_corner(self):
        # The start (1, 1) comes to lie at (2, 2): one row above and one column to the left are outside.
        np.testing.assert_array_equal(
            context(5)[1],
            [
                [1, 1, 1, 1, 1],
                [1, 1, 1, 1, 1],
                [1, 1, 0, 0, 1],
                [1, 1, 1, 0, 0],
                [1, 1, 0, 0, 0],
            ],
        )

    def test_crop_when_start_is_in_the_bottom_right_corner(self):
        np.testing.assert_array_equal(
            context(5, start=(3, 3), goal=(1, 1))[1],
            [
                [0, 0, 1, 1, 1],
                [1, 0, 0, 1, 1],
                [0, 0, 0, 1, 1],
                [1, 1, 1, 1, 1],
                [1, 1, 1, 1, 1],
            ],
        )

    def test_crop_when_context_size_is_even(self):
        # The start (2, 2) comes to lie at (4 // 2, 4 // 2): two cells before it, one behind.
        np.testing.assert_array_equal(
            context(4, start=(2, 2))[1],
            [[1, 1, 1, 1], [1, 0, 0, 1], [1, 1, 0, 0], [1, 0, 0, 0]],
        )

    def test_crop_when_context_is_larger_than_the_maze(self):
        # The start (1, 1) comes to lie at (4, 4), so the maze at (3, 3).
        expected = np.ones((9, 9))
        expected[3:8, 3:8] = WALLS
        np.testing.assert_array_equal(context(9)[1], expected)

    @pytest.mark.parametrize("context_size", range(3, 13))
    @pytest.mark.parametrize("start", [(1, 1), (1, 2), (2, 3), (3, 1)])
    def test_crop_when_start_is_looked_up(self, context_size, start):
        plane = context(context_size, start=start)[1]
        half = context_size // 2
        for row, column in np.ndindex(context_size, context_size):
            cell = (start[0] + row - half, start[1] + column - half)
            inside = 0 <= cell[0] < 5 and 0 <= cell[1] < 5
            assert plane[row, column] == (WALLS[cell[0]][cell[1]] if inside else 1)


class TestGlobalMap:
    def test_map_when_context_is_larger(self):
        # Each cell becomes 2 x 2.
        np.testing.assert_array_equal(context(10)[0], np.kron(WALLS, np.ones((2, 2))))

    def test_map_when_context_is_larger_and_no_multiple(self):
        # Row i of 7 shows row floor(5 i / 7) of 5: 0, 0, 1, 2, 2, 3, 4.
        index = [0, 0, 1, 2, 2, 3, 4]
        np.testing.assert_array_equal(context(7)[0], np.array(WALLS)[np.ix_(index, index)])

    def test_map_when_context_is_smaller(self):
        walls = np.ones((6, 6), dtype=bool)
        walls[1:5, 1:4] = False
        # Thirds of two cells a side: the top left one holds one free cell of four.
        expected = [[0.75, 0.5, 1], [0.5, 0, 1], [0.75, 0.5, 1]]
        np.testing.assert_allclose(build_context(walls, (1, 1), (4, 3), 3)[0], expected, atol=1e-6)

    def test_map_when_context_is_smaller_and_no_divisor(self):
        # A third of 5 cells a side is 5/3: the top left one holds 2/3 x 2/3 of the free cell (1, 1), of 25/9.
        found = context(3)[0]
        assert found[0, 0] == pytest.approx(1 - (4 / 9) / (25 / 9), abs=1e-6)
        # The middle one, from 5/3 to 10/3: of rows 1, 2, 3 the shares 1/3, 1, 1/3, and so of columns.
        share = np.array([1 / 3, 1, 1 / 3])
        expected = share @ np.array(WALLS)[1:4, 1:4] @ share / (25 / 9)
        assert found[1, 1] == pytest.approx(expected, abs=1e-6)
        assert found.mean() == pytest.approx(np.mean(WALLS), abs=1e-6)


class TestMarks:
    @pytest.mark.parametrize(("context_size", "start", "goal"), [(3, (0, 0), (1, 1)), (7, (1, 1), (4, 4))])
    def test_marks_when_sizes_differ(self, context_size, start, goal):
        # (r M // N, c M // N): of 3, 1 * 3 // 5 = 0 and 3 * 3 // 5 = 1; of 7, 7 // 5 = 1 and 21 // 5 = 4.
        planes = context(context_size)
        assert marks(planes[3]) == [start]
        assert marks(planes[2]) == [goal]

    def test_marks_when_row_and_column_differ(self):
        planes = context(10, start=(1, 2), goal=(3, 1))
        assert marks(planes[3]) == [(2, 4)]
        assert marks(planes[2]) == [(6, 2)]

    @pytest.mark.parametrize("context_size", [3, 4, 5, 10, 15])
    def test_marks_when_map_is_shrunk_or_a_multiple(self, context_size):
        # A mark stands on what the map shows of its cell. (At M = 7, (1, 1) is marked at (1, 1), which shows (0, 0).)
        for start in MAZE.free_cells:
            planes = context(context_size, start=tuple(start))
            assert planes[0][marks(planes[3])[0]] < 1


@pytest.mark.parametrize(("size", "expected"), [(5, 5), (13, 13), (21, 21), (22, 21), (255, 21)])
def test_default_context_size_when_mazes_grow(size, expected):
    assert default_context_size(size) == expected
