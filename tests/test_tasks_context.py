"""The four planes of the context, by hand on a 5 x 5 maze."""

from __future__ import annotations

import numpy as np
import pytest
from simple_mazes import field

from mazebench.maps.text import parse_maze
from mazebench.tasks.context import build_context
from mazebench.tasks.task import Task

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
    def test_planes_show_walls_goal_and_start(self):
        planes = context(5)
        assert planes.shape == (4, 5, 5)
        assert planes.dtype == np.float32
        np.testing.assert_array_equal(planes[0], WALLS)
        assert marks(planes[2]) == [GOAL]
        assert marks(planes[3]) == [START]


class TestLocalMap:
    @pytest.mark.parametrize("context_size", range(3, 13))
    @pytest.mark.parametrize("start", [(1, 1), (1, 2), (2, 3), (3, 1)])
    def test_the_crop_shows_what_lies_around_the_start(self, context_size, start):
        plane = context(context_size, start=start)[1]
        half = context_size // 2
        for row, column in np.ndindex(context_size, context_size):
            cell = (start[0] + row - half, start[1] + column - half)
            inside = 0 <= cell[0] < 5 and 0 <= cell[1] < 5
            assert plane[row, column] == (WALLS[cell[0]][cell[1]] if inside else 1)


class TestGlobalMap:
    def test_a_larger_map_repeats_cells(self):
        # Each cell becomes 2 x 2.
        np.testing.assert_array_equal(context(10)[0], np.kron(WALLS, np.ones((2, 2))))

    def test_a_smaller_map_shows_shares_of_walls(self):
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
    def test_marks_are_scaled_with_the_map(self, context_size, start, goal):
        # (r M // N, c M // N): of 3, 1 * 3 // 5 = 0 and 3 * 3 // 5 = 1; of 7, 7 // 5 = 1 and 21 // 5 = 4.
        planes = context(context_size)
        assert marks(planes[3]) == [start]
        assert marks(planes[2]) == [goal]

    @pytest.mark.parametrize("context_size", [3, 4, 5, 10, 15])
    def test_a_mark_stands_on_what_the_map_shows_of_its_cell(self, context_size):
        # A mark stands on what the map shows of its cell. (At M = 7, (1, 1) is marked at (1, 1), which shows (0, 0).)
        for start in MAZE.free_cells:
            planes = context(context_size, start=tuple(start))
            assert planes[0][marks(planes[3])[0]] < 1


@pytest.mark.parametrize(("size", "expected"), [(5, 5), (21, 21), (22, 21)])
def test_the_context_has_the_mazes_size_by_default_and_21_at_most(size, expected):
    assert Task.of(mazes=field(size)).context_size == expected
