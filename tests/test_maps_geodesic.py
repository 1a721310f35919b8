"""Exact shortest paths of a disc: worked examples, and Dijkstra's algorithm on a grid."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse import csgraph
from simple_mazes import clearance

from mazebench.maps.geodesic import DiscPaths, length_between
from mazebench.maps.kinds import generate
from mazebench.maps.maze import MAX_SIZE, Maze, cell_to_point

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


class TestWorkedExamples:
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

    def test_length_in_room_without_corners(self):
        assert length(ROOM, (1, 1), (1, 5)) == pytest.approx(3.5, abs=1e-12)
        assert length(ROOM, (1, 1), (3, 3)) == pytest.approx(np.hypot(1.5, 1.5), abs=1e-12)
        # The disc can't reach the goal's nearest corner, which is on the wall, but the point `RADIUS` away from it.
        assert length(ROOM, (3, 1), (1, 5)) == pytest.approx(np.hypot(3.5, 1.5), abs=1e-12)
        near_wall = DiscPaths(parse(ROOM), RADIUS).length(np.array([1.15, 5.85]), (1, 5))
        assert near_wall == pytest.approx(5 - 1.15, abs=1e-12)


@pytest.mark.parametrize("kind", ["dfs", "cave", "warehouse"])
def test_a_path_in_a_part_of_a_large_maze_is_as_long_as_in_all_of_it(kind):
    maze = generate(kind, 129, np.random.default_rng(0))
    start, *_, middle, _ = map(tuple, maze.free_cells[:: len(maze.free_cells) // 4].tolist())
    expected = DiscPaths(maze, RADIUS).length(maze.point(start), middle)
    assert length_between(maze, RADIUS, start, middle) == pytest.approx(expected, abs=1e-9)


def test_a_path_from_corner_to_corner_of_the_largest_maze_is_found():
    walls = np.ones((MAX_SIZE, MAX_SIZE), dtype=bool)
    walls[1:-1, 1:-1] = False
    walls[2:-1, 2] = walls[1:-2, -3] = True  # up the first column, across, and up the last one
    last = MAX_SIZE - 2
    expected = 2 * (last - 1) + np.hypot(last - 4, last - 1)
    assert length_between(Maze(walls), RADIUS, (last, 1), (1, last)) == pytest.approx(expected, rel=1e-3)


class TestGrid:
    @pytest.mark.parametrize("radius", [0.05, 0.15, 0.25])
    @pytest.mark.parametrize("seed", range(6))
    def test_no_path_on_a_grid_is_shorter_and_the_shortest_is_little_longer(self, seed, radius):
        rng = np.random.default_rng(seed)
        maze = generate(("dfs", "obstacles", "rooms")[seed % 3], 7, rng)
        cell = tuple(rng.choice(maze.free_cells).tolist())
        goal = tuple(rng.choice(maze.cells_at(cell, maze.distances(cell).max() - 1)).tolist())
        start = maze.point(cell) + rng.uniform(radius - 0.5, 0.5 - radius, size=2)  # any point of a cell
        found, on_grid = DiscPaths(maze, radius).length(start, goal), grid_length(maze, radius, start, goal)
        assert found - 2e-3 <= on_grid <= 1.02 * found + 2 * STEP


STEP = 1 / 12  # of the grid, in cells
# Straight to a neighbour in 32 directions, 18 degrees apart at most: a way of two of them is 1.3 % longer at most.
NEIGHBOURS = [(x, y) for x in range(-3, 4) for y in range(-3, 4) if np.gcd(x, y) == 1 and (x, y) > (0, 0)]


def grid_length(maze: Maze, radius: float, start: np.ndarray, goal: tuple[int, int]) -> float:
    """The length of a shortest path from `start`, a point of the grid, to any of its points in the goal's cell."""
    reach = round(maze.size / STEP)
    index = np.arange(-reach, reach + 1)
    lattice = np.stack(np.meshgrid(index, index, indexing="ij"), axis=-1).reshape(-1, 2)
    points = start + STEP * lattice
    number = np.arange(len(points)).reshape(len(index), len(index))
    inside = ((points > 0) & (points < maze.size)).all(axis=1)
    free = inside.copy()
    free[inside] = clearance(maze.walls, points[inside]) >= radius

    ends, lengths = [], []
    for x, y in NEIGHBOURS:
        first = number[: len(index) - x, max(0, -y) : len(index) - max(0, y)].ravel()
        second = number[x:, max(0, y) : len(index) + min(0, y)].ravel()
        both = free[first] & free[second]
        first, second = first[both], second[both]
        for share in np.arange(1, 8) / 8:  # the disc fits all along
            fits = clearance(maze.walls, (1 - share) * points[first] + share * points[second]) >= radius
            first, second = first[fits], second[fits]
        ends.append(np.stack([first, second]))
        lengths.append(np.full(len(first), STEP * np.hypot(x, y)))
    graph = sparse.coo_array((np.concatenate(lengths), np.concatenate(ends, axis=1)), (len(points),) * 2)
    distances = csgraph.dijkstra(graph.tocsr(), directed=False, indices=number[reach, reach])
    in_goal = (np.abs(points - cell_to_point(goal, maze.size)) <= 0.5).all(axis=1)
    return float(distances[in_goal].min())
