"""Exact shortest paths of a disc: worked examples, laws that lengths obey, and an independent brute force."""

from __future__ import annotations

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies
from scipy import ndimage
from scipy.sparse import csgraph

from mazebench.errors import InputError
from mazebench.maps.geodesic import DiscPaths
from mazebench.maps.maze import Maze, cell_to_point, point_to_cell

RADIUS = 0.15
RADII = (0.02, 0.15, 0.3, 0.45)

L_TURN = """
#####
#...#
###.#
###.#
#####
"""
PILLAR = """
#######
#.....#
#.....#
#..#..#
#.....#
#.....#
#######
"""
# The walls at (2, 2) and (3, 3) meet in a corner.
CHECKERBOARD = """
#####
#...#
#.#.#
#..##
#####
"""
ROOM = """
#######
#.....#
#.....#
#.....#
#.....#
#.....#
#######
"""


def parse(text: str) -> Maze:
    return Maze(np.array([[character == "#" for character in line] for line in text.split()]))


def length(text: str, start: tuple[int, int], goal: tuple[int, int], radius: float = RADIUS) -> float:
    maze = parse(text)
    return DiscPaths(maze, radius).length(cell_to_point(start, maze.size), goal)


def random_walls(rng: np.random.Generator, size: int) -> np.ndarray:
    """Open fields to mazes with loops, by the share of walls; every second one on the odd lattice, with long walls."""
    inner = rng.random((size - 2, size - 2)) < rng.uniform(0.05, 0.6)
    if rng.random() < 0.5:
        inner[::2, ::2] = False
        inner[1::2, 1::2] |= rng.random(inner[1::2, 1::2].shape) < 0.9
    inner[tuple(rng.integers(size - 2, size=2))] = False
    areas, _ = ndimage.label(~np.pad(inner, 1, constant_values=True))
    return areas != np.argmax(np.bincount(areas.ravel())[1:]) + 1


def random_start(maze: Maze, radius: float, rng: np.random.Generator) -> np.ndarray:
    """As often the centre of a free cell, any point the disc can be at, or such a point close to a corner of a cell."""
    kind = rng.integers(3)
    while True:
        centre = cell_to_point(random_cell(maze, rng), maze.size)
        angle = rng.uniform(0, 2 * np.pi)
        near_corner = centre - 0.5 + rng.uniform(1, 1.5) * radius * np.array([np.cos(angle), np.sin(angle)])
        point = (centre, centre + rng.uniform(-0.5, 0.5, size=2), near_corner)[kind]
        if clearance(maze, point[None], point[None])[0] >= radius:
            return point


def random_cell(maze: Maze, rng: np.random.Generator) -> tuple[int, int]:
    return tuple(map(int, maze.free_cells[rng.integers(len(maze.free_cells))]))


@strategies.composite
def queries(draw) -> tuple[Maze, float, np.ndarray, tuple[int, int]]:
    rng = np.random.default_rng(draw(strategies.integers(0, 2**32 - 1)))
    maze = Maze(random_walls(rng, draw(strategies.integers(5, 15))))
    radius = draw(strategies.sampled_from(RADII))
    return maze, radius, random_start(maze, radius, rng), random_cell(maze, rng)


def many(num_examples: int):
    return hypothesis.settings(max_examples=num_examples, deadline=None)


class TestWorkedExamples:
    def test_a_start_in_the_goal_is_0_away(self):
        assert length(L_TURN, (1, 1), (1, 1)) == 0
        paths = DiscPaths(parse(L_TURN), RADIUS)
        assert paths.length(np.array([2.0, 3.5]), (1, 1)) == 0  # on the goal's right side
        np.testing.assert_array_equal(paths.path(np.array([2.0, 3.5]), (1, 1)), [[2.0, 3.5]])

    def test_length_in_straight_corridor(self):
        corridor = "######\n#....#\n######\n######\n######\n######"
        assert length(corridor, (1, 1), (1, 4)) == pytest.approx(2.5, abs=1e-12)

    @pytest.mark.parametrize("radius", RADII)
    def test_length_around_one_corner(self, radius):
        # From (1.5, 3.5) to the circle about (3, 3), over it to its rightmost point, 1 m down to the goal's upper side.
        heading = np.arcsin(radius / np.sqrt(2.5)) - np.arctan2(0.5, 1.5)
        if heading > 0:
            pytest.skip("the corridor's upper wall is in the way")
        expected = np.sqrt(2.5 - radius**2) + radius * (np.pi / 2 + heading) + 1
        assert length(L_TURN, (1, 1), (3, 3), radius) == pytest.approx(expected, abs=1e-12)

    @pytest.mark.parametrize("radius", RADII)
    def test_length_around_pillar(self, radius):
        # Up to the circle about (3, 4), 1 m along the pillar, over the circle about (4, 4), down to the goal's corner.
        heading = np.arctan2(0.5, 1.5) + np.arcsin(radius / np.sqrt(2.5))
        expected = np.sqrt(2.5 - radius**2) + radius * heading + 1 + radius * np.arcsin(radius) + np.sqrt(1 - radius**2)
        assert length(PILLAR, (3, 1), (3, 5), radius) == pytest.approx(expected, abs=1e-12)

    @pytest.mark.parametrize("radius", RADII)
    def test_walls_that_meet_in_a_corner_can_not_be_passed(self, radius):
        # The centres are 1.41 m apart, but the disc must go round three corners of the wall at (2, 2).
        turn = np.arcsin(radius / np.sqrt(0.5))
        expected = np.sqrt(0.5 - radius**2) + radius * (np.pi / 4 + turn) + 2 * (1 + radius * np.pi / 2)
        assert length(CHECKERBOARD, (3, 2), (2, 3), radius) == pytest.approx(expected, abs=1e-12)

    def test_length_in_room_without_corners(self):
        assert length(ROOM, (1, 1), (1, 5)) == pytest.approx(3.5, abs=1e-12)
        assert length(ROOM, (1, 1), (3, 3)) == pytest.approx(np.hypot(1.5, 1.5), abs=1e-12)
        # The disc can't reach the goal's nearest corner, which is on the wall, but the point `RADIUS` away from it.
        assert length(ROOM, (3, 1), (1, 5)) == pytest.approx(np.hypot(3.5, 1.5), abs=1e-12)
        near_wall = DiscPaths(parse(ROOM), RADIUS).length(np.array([1.15, 5.85]), (1, 5))
        assert near_wall == pytest.approx(5 - 1.15, abs=1e-12)


class TestInput:
    @pytest.mark.parametrize("radius", [0, -0.1, 0.5, float("nan")])
    def test_a_radius_out_of_range_is_refused(self, radius):
        with pytest.raises(InputError, match=r"expected a radius above 0 and below 0\.5 m, found"):
            DiscPaths(parse(L_TURN), radius)

    @pytest.mark.parametrize("start", [(1.1, 3.5), (0.5, 0.5), (-1, 2), (9, 2), (float("nan"), 1), (1.5, 3.5, 0)])
    def test_a_start_that_is_not_free_is_refused(self, start):
        with pytest.raises(InputError, match=r"expected a start \(x, y\) at least 0\.15 m from every wall, found \["):
            DiscPaths(parse(L_TURN), RADIUS).length(np.array(start), (1, 1))


class TestLaws:
    @many(60)
    @hypothesis.given(queries())
    def test_lengths_stay_when_a_maze_is_turned_or_mirrored(self, query):
        maze, radius, (x, y), (row, column) = query
        size, last = maze.size, maze.size - 1
        turned = Maze(np.rot90(maze.walls)), (size - y, x), (last - column, row)
        mirrored = Maze(maze.walls[:, ::-1]), (size - x, y), (row, last - column)
        transposed = Maze(maze.walls.T), (size - y, size - x), (column, row)
        expected = DiscPaths(maze, radius).length(np.array([x, y]), (row, column))
        for other, start, goal in (turned, mirrored, transposed):
            assert DiscPaths(other, radius).length(np.array(start), goal) == pytest.approx(expected, abs=1e-9)

    @many(100)
    @hypothesis.given(queries())
    def test_a_path_is_free_and_as_long_as_its_length(self, query):
        maze, radius, start, goal = query
        paths = DiscPaths(maze, radius)
        points = paths.path(start, goal, arc_step=1e-3)
        np.testing.assert_array_equal(points[0], start)
        assert np.all(np.abs(points[-1] - cell_to_point(goal, maze.size)) <= 0.5 + 1e-9)
        assert clearance(maze, points[:-1], points[1:]).min(initial=0.5) >= radius - 1e-5
        polyline = np.hypot(*np.diff(points, axis=0).T).sum()
        # A chord of an arc of length s is s^3 / (24 r^2) shorter; a path turns by less than 100 radians here.
        assert 0 <= paths.length(start, goal) - polyline + 1e-9 <= 100 / (24 * radius) * 1e-6 + 2e-9


class TestBruteForce:
    @pytest.mark.parametrize("seed", range(18))
    def test_lengths_are_those_of_a_visibility_graph(self, seed):
        rng = np.random.default_rng(seed)
        maze = Maze(random_walls(rng, (7, 8, 9)[seed % 3]))
        radius = (0.05, 0.15, 0.25)[seed // 3 % 3]
        paths, brute_force = DiscPaths(maze, radius), VisibilityGraph(maze, radius)
        for _ in range(3):
            start, goal = random_start(maze, radius, rng), random_cell(maze, rng)
            excess = brute_force.length(start, goal) - paths.length(start, goal)
            assert -1e-9 <= excess <= 1e-3


class VisibilityGraph:
    """Brute force: all straight lines between samples, tested against every wall.

    The circle about each lattice point is replaced by a polygon around it whose sides touch it, so that every path
    found is one of the disc; its excess over the shortest falls with the square of the samples' distances. Radii are to
    be multiples of `side_step`, for the disc to reach the ends of a goal's side between walls.
    """

    def __init__(self, maze: Maze, radius: float, num_sides: int = 64, side_step: float = 0.025):
        self._maze, self._radius = maze, radius
        self._side_samples = np.linspace(-0.5, 0.5, round(1 / side_step) + 1)
        angle = 2 * np.pi * (np.arange(num_sides) + 0.5) / num_sides
        polygon = radius / np.cos(np.pi / num_sides) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        lattice = np.argwhere(np.ones((maze.size - 1, maze.size - 1))) + 1
        vertices = self._feasible((lattice[:, None] + polygon).reshape(-1, 2))
        # Those about lattice points in the open would change no path.
        self._vertices = vertices[clearance(maze, vertices, vertices) <= radius / np.cos(np.pi / num_sides) + 1e-9]
        self._edges = self._visible(self._vertices, self._vertices)

    def length(self, start: np.ndarray, goal: tuple[int, int]) -> float:
        centre = cell_to_point(goal, self._maze.size)
        if np.all(np.abs(start - centre) <= 0.5):
            return 0.0
        # A start may be so near the goal that only the nearest point of its side will do.
        samples = np.append(self._side_samples, np.clip(start - centre, -0.5, 0.5))
        sides = np.concatenate([np.stack([samples, np.full_like(samples, x)], axis=1) for x in (-0.5, 0.5)])
        ends = self._feasible(centre + np.concatenate([sides, sides[:, ::-1]]))
        first, last = self._visible(start[None], self._vertices), self._visible(self._vertices, ends)
        direct = self._visible(start[None], ends)
        graph = np.full((len(self._vertices) + 1,) * 2, np.inf)
        graph[:-1, :-1] = self._edges
        graph[-1, :-1] = first
        distances = csgraph.dijkstra(csgraph.csgraph_from_dense(graph), indices=len(self._vertices))[:-1, None]
        return float(np.min(np.concatenate([direct, distances + last])))

    def _feasible(self, points: np.ndarray) -> np.ndarray:
        return points[clearance(self._maze, points, points) >= self._radius - 1e-9]

    def _visible(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """`[len(first), len(second)]`: distances, infinite where the disc can't go straight."""
        i, j = np.indices((len(first), len(second))).reshape(2, -1)
        for share in np.arange(1, 8) / 8:
            row, column = point_to_cell((1 - share) * first[i] + share * second[j], self._maze.size).T
            free = ~self._maze.walls[row, column]
            i, j = i[free], j[free]
        clear = clearance(self._maze, first[i], second[j], enough=self._radius - 1e-9) >= self._radius - 1e-9
        i, j = i[clear], j[clear]
        result = np.full((len(first), len(second)), np.inf)
        result[i, j] = np.hypot(*(first[i] - second[j]).T)
        return result


def clearance(maze: Maze, start: np.ndarray, end: np.ndarray, enough: float = 0.0) -> np.ndarray:
    """`[S]`: how near segments come to a wall, at most 0.5, or any distance less than `enough` that one comes."""
    low_end, high_end = np.minimum(start, end), np.maximum(start, end)
    result = np.full(len(start), 0.5)
    for row, column in np.argwhere(maze.walls):
        low = np.array([column, maze.size - 1 - row], dtype=float)
        todo = np.flatnonzero((result >= enough) & np.all((low <= high_end + 0.5) & (low + 1 >= low_end - 0.5), axis=1))
        result[todo] = np.minimum(result[todo], distance_to_square(start[todo], end[todo], low))
    return result


def distance_to_square(start: np.ndarray, end: np.ndarray, low: np.ndarray) -> np.ndarray:
    """`[S]`: distances of segments from the unit square whose lower left corner is `low`."""
    step = end - start
    squared_length = np.maximum(np.sum(step**2, axis=1), 1e-300)
    nearest = [np.hypot(*np.maximum(np.maximum(low - point, point - low - 1), 0).T) for point in (start, end)]
    for corner in low + np.array([[0, 0], [0, 1], [1, 0], [1, 1]]):
        share = np.clip(np.sum((corner - start) * step, axis=1) / squared_length, 0, 1)
        nearest.append(np.hypot(*(start + share[:, None] * step - corner).T))
    return np.where(crosses_square(start, step, low), 0, np.min(nearest, axis=0))


def crosses_square(start: np.ndarray, step: np.ndarray, low: np.ndarray) -> np.ndarray:
    """`[S]` bool: whether segments meet the square, by clipping them to its two slabs."""
    step = np.where(np.abs(step) < 1e-300, 1e-300, step)
    shares = np.stack([(low - start) / step, (low + 1 - start) / step])
    enter = np.maximum(shares.min(axis=0).max(axis=1), 0)
    leave = np.minimum(shares.max(axis=0).min(axis=1), 1)
    return enter <= leave
