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

from mazebench.maps.kinds import generate
from mazebench.maps.maze import (
    Maze,
    MazeError,
    canonical_bytes,
    cell_of_point,
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
            (np.ones((5, 5)), r"^m: expected walls of dtype bool, found float64$"),
            (field(4), r"^m: expected 5 to 1024 cells a side, found 4$"),
            (field(1025), r"^m: expected 5 to 1024 cells a side, found 1025$"),
            (np.ones((5, 5), dtype=bool), r"^m: expected a free cell, found only walls$"),
            (with_cell(field(5), 0, 3, False), r"^m: expected a closed border, found cell \(0, 3\) free$"),
            (with_cell(field(7), 5, 6, False), r"^m: expected a closed border, found cell \(5, 6\) free$"),
            (
                grid("##### #..## ##### ##..# #####"),
                r"^m: expected one connected free area, found 2; cell \(3, 2\) cannot be reached from \(1, 1\)$",
            ),
        ],
    )
    def test_an_illegal_maze_is_refused(self, walls, message):
        with pytest.raises(MazeError, match=message):
            Maze(walls, "m")


class TestValue:
    def test_walls_stay_as_they_are(self):
        walls = field(5)
        maze = Maze(walls)
        walls[2, 2] = True
        assert not maze.walls[2, 2]
        with pytest.raises(ValueError, match="read-only"):
            maze.walls[2, 2] = True

    def test_mazes_are_equal_if_their_walls_are(self):
        assert Maze(field(5), "a") == Maze(field(5), "b")
        assert Maze(field(6)) != Maze(grid(RING))
        assert len({Maze(field(5), "a"), Maze(field(5), "b"), Maze(grid(RING))}) == 2


class TestDistances:
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
    def test_ties_between_shortest_paths_are_broken_up_left_down_right(self, start, goal, path):
        assert path_through_walls(grid(RING), start, goal) == path

    @pytest.mark.parametrize(("start", "goal"), [((0, 0), (1, 1)), ((1, 1), (0, 0)), ((1, 1), (-1, 1))])
    def test_a_path_to_or_from_a_wall_is_refused(self, start, goal):
        with pytest.raises(MazeError, match=r"^m: expected a free cell, found \(-?\d, \d\), a wall or"):
            Maze(field(5), "m").distance(start, goal)

    @many(80)
    @hypothesis.given(mazes(), strategies.integers(0, 1000), strategies.integers(0, 1000))
    def test_distances_are_those_of_a_brute_force_search(self, maze, first, second):
        start, goal = random_cell(maze, first), random_cell(maze, second)
        expected = brute_force_distances(maze.walls, start)
        np.testing.assert_array_equal(maze.distances(start), expected)
        assert maze.distance(start, goal) == maze.distance(goal, start) == expected[goal]
        assert maze.diameter == max(
            brute_force_distances(maze.walls, random_cell(maze, i)).max() for i in range(len(maze.free_cells))
        )

    def test_distances_in_a_maze_that_does_not_keep_them(self):
        maze = generate("cave", 71, np.random.default_rng(0))
        assert not maze.keeps_distances
        source = random_cell(maze, 1)
        expected = brute_force_distances(maze.walls, source)
        np.testing.assert_array_equal(maze.distances(source), expected)
        for distance in (0, 1, 17, expected.max(), expected.max() + 1):
            np.testing.assert_array_equal(maze.cells_at(source, distance), np.argwhere(expected == distance))


class TestConversion:
    @pytest.mark.parametrize(
        ("point", "cell"),
        [
            ((0.5, 4.5), (0, 0)),
            ((0.5, 0.5), (4, 0)),
            ((1.5, 1.5), (3, 1)),
            ((1.0, 1.5), (3, 1)),  # on a vertical line: the right one
            ((1.5, 1.0), (3, 1)),  # on a horizontal line: the upper one
            ((np.nextafter(1, 0), np.nextafter(1, 0)), (4, 0)),
            ((0.0, 0.0), (4, 0)),
            ((-0.1, 5.1), (-1, -1)),  # outside: no clipping
        ],
    )
    def test_a_point_belongs_to_a_cell_and_on_a_line_to_the_right_or_upper_one(self, point, cell):
        np.testing.assert_array_equal(point_to_cell(np.array(point), 5), cell)
        assert cell_of_point(*point, 5) == cell


class TestSymmetries:
    def test_the_eight_symmetries_worked_by_hand(self):
        found = {variant.tobytes() for variant in symmetries(np.array([[1, 2], [3, 4]], dtype=np.uint8))}
        expected = ([1, 2, 3, 4], [2, 4, 1, 3], [4, 3, 2, 1], [3, 1, 4, 2])
        expected += ([1, 3, 2, 4], [3, 4, 1, 2], [4, 2, 3, 1], [2, 1, 4, 3])
        assert found == {bytes(variant) for variant in expected}

    def test_canonical_bytes_are_those_of_every_symmetry(self):
        walls = grid("##### #..## ##.## ##..# #####")
        assert {canonical_bytes(variant) for variant in symmetries(walls)} == {canonical_bytes(walls)}
        assert canonical_bytes(walls) != canonical_bytes(with_cell(walls, 2, 1, False))


class TestPathThroughWalls:
    def test_a_path_goes_through_as_few_walls_as_it_can(self):
        walls = grid("##### #.#.# #.#.# #.#.# #####")
        # One wall has to be paid for; of the three, up comes first and left before right.
        assert path_through_walls(walls, (2, 1), (2, 3)) == [(2, 1), (2, 2), (2, 3)]
        assert path_through_walls(walls, (3, 1), (1, 3)) == [(3, 1), (2, 1), (1, 1), (1, 2), (1, 3)]

    @many(200)
    @hypothesis.given(square_grids(), *[strategies.integers(0, 1000)] * 2)
    def test_a_path_through_walls_is_a_cheapest_one(self, walls, first, second):
        start, goal = (divmod(draw % walls.size, len(walls)) for draw in (first, second))
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
