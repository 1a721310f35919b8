"""The Maze value: what is refused, distances and paths by hand and by brute force, conversions, symmetries."""

from __future__ import annotations

import collections
import heapq
import itertools

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies
from hypothesis.extra import numpy as numpy_strategies
from scipy import ndimage

from mazebench.errors import InputError
from mazebench.maps.maze import (
    MAX_SIZE,
    Maze,
    MazeError,
    canonical_bytes,
    cell_to_point,
    path_through_walls,
    point_to_cell,
    symmetries,
)

RING = """
######
#....#
#.##.#
#.##.#
#....#
######
"""
SNAKE = """
#######
#.....#
#####.#
#.....#
#.#####
#.....#
#######
"""


def grid(text: str) -> np.ndarray:
    return np.array([[character == "#" for character in line] for line in text.split()])


def field(size: int) -> np.ndarray:
    return np.pad(np.zeros((size - 2, size - 2), dtype=bool), 1, constant_values=True)


def with_cell(walls: np.ndarray, row: int, column: int, wall: bool) -> np.ndarray:
    changed = walls.copy()
    changed[row, column] = wall
    return changed


def many(num_examples: int):
    return hypothesis.settings(max_examples=num_examples, deadline=None)


@strategies.composite
def mazes(draw) -> Maze:
    rng = np.random.default_rng(draw(strategies.integers(0, 2**32 - 1)))
    size = draw(strategies.integers(5, 12))
    inner = rng.random((size - 2, size - 2)) < rng.uniform(0, 0.6)
    inner[tuple(rng.integers(size - 2, size=2))] = False
    areas, _ = ndimage.label(~np.pad(inner, 1, constant_values=True))
    return Maze(areas != np.argmax(np.bincount(areas.ravel())[1:]) + 1)


def square_grids() -> strategies.SearchStrategy[np.ndarray]:
    return strategies.integers(2, 7).flatmap(lambda size: numpy_strategies.arrays(bool, (size, size)))


def random_cell(maze: Maze, draw: int) -> tuple[int, int]:
    row, column = maze.free_cells[draw % len(maze.free_cells)]
    return int(row), int(column)


def neighbours(cell: tuple[int, int]) -> list[tuple[int, int]]:
    row, column = cell
    return [(row - 1, column), (row, column - 1), (row + 1, column), (row, column + 1)]


def brute_force_distances(walls: np.ndarray, source: tuple[int, int]) -> np.ndarray:
    distances = np.full(walls.shape, -1)
    distances[source] = 0
    queue = collections.deque([source])
    while queue:
        cell = queue.popleft()
        for other in neighbours(cell):
            if not walls[other] and distances[other] < 0:
                distances[other] = distances[cell] + 1
                queue.append(other)
    return distances


class TestValidation:
    @pytest.mark.parametrize(
        ("walls", "message"),
        [
            (np.ones((5, 6), dtype=bool), r"^m: expected a square grid, found shape \(5, 6\)$"),
            (np.ones(25, dtype=bool), r"^m: expected a square grid, found shape \(25,\)$"),
            (np.ones((5, 5, 5), dtype=bool), r"^m: expected a square grid, found shape \(5, 5, 5\)$"),
            (np.ones((5, 5)), r"^m: expected walls of dtype bool, found float64$"),
            (field(4), r"^m: expected 5 to 255 cells a side, found 4$"),
            (field(256), r"^m: expected 5 to 255 cells a side, found 256$"),
            (np.ones((0, 0), dtype=bool), r"^m: expected 5 to 255 cells a side, found 0$"),
            (np.ones((5, 5), dtype=bool), r"^m: expected a free cell, found only walls$"),
            (with_cell(field(5), 0, 3, False), r"^m: expected a closed border, found cell \(0, 3\) free$"),
            (with_cell(field(5), 4, 2, False), r"^m: expected a closed border, found cell \(4, 2\) free$"),
            (with_cell(field(5), 2, 0, False), r"^m: expected a closed border, found cell \(2, 0\) free$"),
            (with_cell(field(7), 5, 6, False), r"^m: expected a closed border, found cell \(5, 6\) free$"),
            (
                grid("##### #..## ##### ##..# #####"),
                r"^m: expected one connected free area, found 2; cell \(3, 2\) cannot be reached from \(1, 1\)$",
            ),
            (
                grid("##### #.#.# ##.## #.#.# #####"),
                r"^m: expected one connected free area, found 5; cell \(1, 3\) cannot be reached from \(1, 1\)$",
            ),
        ],
    )
    def test_maze_when_illegal(self, walls, message):
        with pytest.raises(MazeError, match=message):
            Maze(walls, "m")

    @pytest.mark.parametrize("size", [5, 6, MAX_SIZE])
    def test_maze_when_smallest_even_or_largest(self, size):
        assert Maze(field(size)).size == size

    def test_maze_error_when_caught_as_input_error(self):
        with pytest.raises(InputError):
            Maze(np.ones((5, 5), dtype=bool))

    @many(300)
    @hypothesis.given(numpy_strategies.arrays(bool, strategies.tuples(*[strategies.integers(0, 8)] * 2)))
    def test_maze_when_grid_is_arbitrary(self, walls):
        try:
            maze = Maze(walls)
        except MazeError:
            return
        np.testing.assert_array_equal(maze.walls, walls)

    @many(300)
    @hypothesis.given(numpy_strategies.arrays(bool, (4, 4)))
    def test_maze_when_inside_is_arbitrary(self, inner):
        walls = np.pad(inner, 1, constant_values=True)
        num_areas = ndimage.label(~walls)[1]
        if num_areas == 1:
            np.testing.assert_array_equal(Maze(walls).walls, walls)
        else:
            with pytest.raises(MazeError, match="free"):
                Maze(walls)


class TestValue:
    def test_walls_when_written_to(self):
        maze = Maze(field(5))
        with pytest.raises(ValueError, match="read-only"):
            maze.walls[2, 2] = True

    def test_walls_when_source_array_changes(self):
        walls = field(5)
        maze = Maze(walls)
        walls[2, 2] = True
        assert not maze.walls[2, 2]
        assert walls.flags.writeable

    def test_equality_when_names_differ(self):
        assert Maze(field(5), "a") == Maze(field(5), "b")
        assert hash(Maze(field(5), "a")) == hash(Maze(field(5), "b"))
        assert len({Maze(field(5)), Maze(field(5)), Maze(grid(RING))}) == 2

    def test_equality_when_walls_or_types_differ(self):
        assert Maze(field(5)) != Maze(field(6))
        assert Maze(field(6)) != Maze(grid(RING))
        assert Maze(field(5)) != "maze"

    def test_free_cells_when_listed(self):
        maze = Maze(grid("##### #..## ##.## ##..# #####"))
        assert maze.free_cells.tolist() == [[1, 1], [1, 2], [2, 2], [3, 2], [3, 3]]

    def test_is_free_when_outside(self):
        maze = Maze(field(5))
        assert maze.is_free((1, 1))
        assert not maze.is_free((0, 0))
        for cell in [(-1, -1), (-2, 2), (2, -2), (5, 2), (2, 5)]:
            assert not maze.is_free(cell)

    @pytest.mark.parametrize("cell", [(0, 0), (-2, 2), (5, 2)])
    def test_require_free_when_wall_or_outside(self, cell):
        with pytest.raises(MazeError, match=rf"^m: expected a free cell, found \({cell[0]}, {cell[1]}\), a wall or"):
            Maze(field(5), "m").require_free(cell)


class TestDistances:
    def test_distances_when_walked_round_a_block(self):
        expected = [
            [-1, -1, -1, -1, -1, -1],
            [-1, 0, 1, 2, 3, -1],
            [-1, 1, -1, -1, 4, -1],
            [-1, 2, -1, -1, 5, -1],
            [-1, 3, 4, 5, 6, -1],
            [-1, -1, -1, -1, -1, -1],
        ]
        maze = Maze(grid(RING))
        assert maze.distances((1, 1)).tolist() == expected
        assert maze.distance((1, 1), (4, 4)) == 6
        assert maze.distance((2, 4), (3, 1)) == 6
        assert maze.diameter == 6

    def test_distance_when_corridor_winds(self):
        maze = Maze(grid(SNAKE))
        assert maze.distance((1, 1), (5, 5)) == 16
        assert maze.diameter == 16

    def test_cells_at_when_listed_in_reading_order(self):
        maze = Maze(grid(RING))
        assert maze.cells_at((1, 1), 3).tolist() == [[1, 4], [4, 1]]
        assert maze.cells_at((1, 1), 0).tolist() == [[1, 1]]
        assert maze.cells_at((1, 1), 7).tolist() == []

    @pytest.mark.parametrize(
        ("start", "goal", "path"),
        [
            # Both ways round the block are 6 long.
            ((1, 1), (4, 4), [(1, 1), (2, 1), (3, 1), (4, 1), (4, 2), (4, 3), (4, 4)]),
            ((4, 4), (1, 1), [(4, 4), (3, 4), (2, 4), (1, 4), (1, 3), (1, 2), (1, 1)]),
            ((1, 4), (4, 1), [(1, 4), (1, 3), (1, 2), (1, 1), (2, 1), (3, 1), (4, 1)]),
            ((4, 1), (1, 4), [(4, 1), (3, 1), (2, 1), (1, 1), (1, 2), (1, 3), (1, 4)]),
            ((2, 1), (2, 1), [(2, 1)]),
        ],
    )
    def test_shortest_path_when_ties_are_broken_up_left_down_right(self, start, goal, path):
        assert Maze(grid(RING)).shortest_path(start, goal) == path

    def test_shortest_path_when_field_is_open(self):
        maze = Maze(field(5))
        assert maze.shortest_path((3, 1), (1, 3)) == [(3, 1), (2, 1), (1, 1), (1, 2), (1, 3)]
        assert maze.shortest_path((3, 3), (1, 1)) == [(3, 3), (2, 3), (1, 3), (1, 2), (1, 1)]
        assert maze.shortest_path((1, 3), (3, 1)) == [(1, 3), (1, 2), (1, 1), (2, 1), (3, 1)]

    @pytest.mark.parametrize("method", ["distance", "shortest_path"])
    @pytest.mark.parametrize(("start", "goal"), [((0, 0), (1, 1)), ((1, 1), (0, 0)), ((1, 1), (-1, 1))])
    def test_distance_and_path_when_an_end_is_a_wall(self, method, start, goal):
        with pytest.raises(MazeError, match="expected a free cell"):
            getattr(Maze(field(5)), method)(start, goal)

    def test_distance_when_maze_is_too_large_for_all_pairs(self):
        maze = Maze(field(61))
        assert maze.distance((1, 1), (59, 59)) == 116
        assert maze.diameter == 116
        assert maze.distances((30, 30))[1, 1] == 58

    @many(80)
    @hypothesis.given(mazes(), strategies.integers(0, 1000), strategies.integers(0, 1000))
    def test_distances_when_compared_with_brute_force(self, maze, first, second):
        start, goal = random_cell(maze, first), random_cell(maze, second)
        expected = brute_force_distances(maze.walls, start)
        np.testing.assert_array_equal(maze.distances(start), expected)
        assert maze.distance(start, goal) == maze.distance(goal, start) == expected[goal]
        assert maze.diameter == max(
            brute_force_distances(maze.walls, random_cell(maze, i)).max() for i in range(len(maze.free_cells))
        )

    @many(80)
    @hypothesis.given(mazes(), strategies.integers(0, 1000), strategies.integers(0, 1000))
    def test_shortest_path_when_maze_is_arbitrary(self, maze, first, second):
        start, goal = random_cell(maze, first), random_cell(maze, second)
        path = maze.shortest_path(start, goal)
        assert (path[0], path[-1]) == (start, goal)
        assert len(path) - 1 == maze.distance(start, goal)
        assert not any(maze.walls[cell] for cell in path)
        assert all(after in neighbours(before) for before, after in itertools.pairwise(path))


class TestConversion:
    @pytest.mark.parametrize(
        ("cell", "point"), [((0, 0), (0.5, 4.5)), ((4, 0), (0.5, 0.5)), ((0, 4), (4.5, 4.5)), ((3, 1), (1.5, 1.5))]
    )
    def test_centre_when_converted_both_ways(self, cell, point):
        np.testing.assert_array_equal(cell_to_point(cell, 5), point)
        np.testing.assert_array_equal(point_to_cell(np.array(point), 5), cell)

    @pytest.mark.parametrize(
        ("point", "cell"),
        [
            ((1.0, 1.5), (3, 1)),  # on a vertical line: the right one
            ((1.5, 1.0), (3, 1)),  # on a horizontal line: the upper one
            ((1.0, 1.0), (3, 1)),
            ((np.nextafter(1, 0), np.nextafter(1, 0)), (4, 0)),
            ((0.0, 0.0), (4, 0)),
            ((-0.1, 5.1), (-1, -1)),  # outside: no clipping
        ],
    )
    def test_point_to_cell_when_on_a_line_or_outside(self, point, cell):
        np.testing.assert_array_equal(point_to_cell(np.array(point), 5), cell)

    def test_conversion_when_batched(self):
        cells = np.array([[[0, 0], [1, 2]], [[3, 3], [4, 1]]])
        points = cell_to_point(cells, 5)
        assert points.shape == (2, 2, 2)
        np.testing.assert_array_equal(points[0, 1], [2.5, 3.5])
        np.testing.assert_array_equal(point_to_cell(points, 5), cells)


class TestSymmetries:
    def test_symmetries_when_grid_has_none(self):
        walls = with_cell(with_cell(field(5), 1, 1, True), 1, 2, True)
        assert len({variant.tobytes() for variant in symmetries(walls)}) == 8

    def test_symmetries_when_worked_by_hand(self):
        found = {variant.tobytes() for variant in symmetries(np.array([[1, 2], [3, 4]], dtype=np.uint8))}
        expected = ([1, 2, 3, 4], [2, 4, 1, 3], [4, 3, 2, 1], [3, 1, 4, 2])
        expected += ([1, 3, 2, 4], [3, 4, 1, 2], [4, 2, 3, 1], [2, 1, 4, 3])
        assert found == {bytes(variant) for variant in expected}

    def test_canonical_bytes_when_equal_up_to_symmetry(self):
        walls = grid(SNAKE)
        assert {canonical_bytes(variant) for variant in symmetries(walls)} == {canonical_bytes(walls)}
        assert canonical_bytes(walls) != canonical_bytes(with_cell(walls, 2, 1, False))


class TestPathThroughWalls:
    def test_path_when_a_free_one_is_left(self):
        # Straight through the wall it would be 4 steps; the way round costs 16.
        assert path_through_walls(grid(SNAKE), (1, 1), (5, 1)) == Maze(grid(SNAKE)).shortest_path((1, 1), (5, 1))

    def test_path_when_cut_off(self):
        walls = grid("##### #.#.# #.#.# #.#.# #####")
        # One wall has to be paid for; of the three, up comes first and left before right.
        assert path_through_walls(walls, (2, 1), (2, 3)) == [(2, 1), (2, 2), (2, 3)]
        assert path_through_walls(walls, (3, 1), (1, 3)) == [(3, 1), (2, 1), (1, 1), (1, 2), (1, 3)]

    def test_path_when_one_thick_wall_or_a_long_detour_is_cheaper(self):
        walls = grid("####### #.##..# #.###.# #.###.# #.#...# #.#..## #######")
        # Two walls in row 1 cost 2000, one wall in row 4 costs 1000 and a detour of 12 steps.
        assert path_through_walls(walls, (1, 1), (1, 4)) == [
            *((row, 1) for row in range(1, 5)),
            *((4, column) for column in range(2, 6)),
            *((row, 5) for row in range(3, 0, -1)),
            (1, 4),
        ]

    @pytest.mark.parametrize(
        ("start", "goal", "path"),
        [
            ((1, 1), (2, 3), [(1, 1), (2, 1), (2, 2), (2, 3)]),  # of three ways the first in the order of ties
            ((2, 3), (1, 1), [(2, 3), (1, 3), (1, 2), (1, 1)]),
            ((2, 3), (2, 3), [(2, 3)]),
        ],
    )
    def test_path_when_start_or_goal_is_a_wall(self, start, goal, path):
        # On a warped map they may be.
        assert path_through_walls(grid("##### #...# #..## #...# #####"), start, goal) == path

    @many(200)
    @hypothesis.given(square_grids(), *[strategies.integers(0, 1000)] * 2)
    def test_path_when_ends_are_free(self, walls, first, second):
        start, goal = (divmod(draw % walls.size, len(walls)) for draw in (first, second))
        walls[start] = walls[goal] = False
        check_path(walls, start, goal)

    @many(200)
    @hypothesis.given(square_grids(), *[strategies.integers(0, 1000)] * 2)
    def test_path_when_ends_are_anywhere(self, walls, first, second):
        check_path(walls, *(divmod(draw % walls.size, len(walls)) for draw in (first, second)))


def check_path(walls: np.ndarray, start: tuple[int, int], goal: tuple[int, int]) -> None:
    path = path_through_walls(walls, start, goal)
    assert (path[0], path[-1]) == (start, goal)
    assert all(after in neighbours(before) for before, after in itertools.pairwise(path))
    assert sum(1000 if walls[cell] else 1 for cell in path[1:]) == cheapest(walls, start, goal)


def cheapest(walls: np.ndarray, start: tuple[int, int], goal: tuple[int, int]) -> int:
    """The cost of a cheapest path, by Dijkstra's algorithm: entering a free cell costs 1, a wall 1000."""
    costs: dict[tuple[int, int], int] = {}
    queue = [(0, start)]
    while queue:
        cost, cell = heapq.heappop(queue)
        if cell in costs:
            continue
        costs[cell] = cost
        for row, column in neighbours(cell):
            if 0 <= row < walls.shape[0] and 0 <= column < walls.shape[1]:
                heapq.heappush(queue, (cost + (1000 if walls[row, column] else 1), (row, column)))
    return costs[goal]
