"""Generators: legal, seeded, and as hard as the paper's mazes."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from mazebench.errors import InputError
from mazebench.maps.generators import STYLES, dfs_walls, generate
from mazebench.maps.maze import Maze, corner_cells
from mazebench.maps.text import format_maze, parse_maze
from mazebench.tasks.build import make_spec
from mazebench.tasks.episode import Episode
from mazebench.tasks.route import plan_route
from mazebench.tasks.shown_map import show_map

DFS_7_OF_SEED_0 = """\
#######
#...#.#
#.#.#.#
#.#...#
#.###.#
#...#.#
#######
"""


@pytest.mark.parametrize("style", sorted(STYLES))
class TestEveryStyle:
    @pytest.mark.parametrize("size", [5, 7, 9, 13, 21, 63, 255])
    def test_mazes_of_all_odd_sizes_are_legal(self, style, size):
        for seed in range(20 if size <= 21 else 1):
            # The constructor of Maze refuses what is not legal.
            assert generate(style, size, np.random.default_rng(seed)).size == size

    def test_the_same_seed_gives_the_same_maze(self, style):
        first, again, other = (generate(style, 21, np.random.default_rng(seed)) for seed in (5, 5, 6))
        assert first == again
        assert first != other

    def test_mazes_of_one_stream_differ(self, style):
        rng = np.random.default_rng(0)
        assert len({generate(style, 13, rng) for _ in range(20)}) == 20

    @pytest.mark.parametrize("size", [-1, 0, 4, 256, 10**9])
    def test_a_size_out_of_bounds_is_refused(self, style, size):
        with pytest.raises(InputError, match=rf"^expected a size of 5 to 255 cells, found {size}$"):
            generate(style, size, np.random.default_rng(0))


@pytest.mark.parametrize("style", ["dfs", "rooms"])
@pytest.mark.parametrize("size", [6, 14, 254])
def test_an_even_size_is_refused_on_the_odd_lattice(style, size):
    with pytest.raises(InputError, match=rf"^style '{style}' makes mazes of odd sizes only, found size {size}$"):
        generate(style, size, np.random.default_rng(0))


def test_obstacles_may_have_an_even_size():
    assert generate("obstacles", 14, np.random.default_rng(0)).size == 14


@pytest.mark.parametrize("size", [5, 9, 13, 21, 51])
def test_rooms_has_rooms_of_9_or_15_cells_and_no_dead_ends(size):
    for seed in range(10):
        free = ~generate("rooms", size, np.random.default_rng(seed)).walls
        neighbours = ndimage.convolve(free.astype(int), [[0, 1, 0], [1, 0, 1], [0, 1, 0]])
        assert (neighbours[free] >= 2).all()
        # Only in rooms are 3 x 3 cells free.
        rooms, num_rooms = ndimage.label(ndimage.binary_opening(free, np.ones((3, 3))))
        assert 1 <= num_rooms <= max(1, (size // 6) ** 2)
        assert set(np.bincount(rooms.ravel())[1:]) <= {9, 15}


def test_an_unknown_style_is_refused():
    with pytest.raises(InputError, match=r"^unknown style 'spiral'; available: dfs, obstacles, rooms$"):
        generate("spiral", 13, np.random.default_rng(0))


def test_dfs_of_seed_0_stays_as_it_is():
    assert format_maze(generate("dfs", 7, np.random.default_rng(0))) == DFS_7_OF_SEED_0


@pytest.mark.parametrize(
    ("size", "rng", "message"),
    [
        ("13", np.random.default_rng(0), "expected a size of 5 to 255 cells, found '13'"),
        (13, 0, r"expected rng as a numpy\.random\.Generator, found int"),
    ],
)
def test_arguments_of_another_type_are_refused(size, rng, message):
    with pytest.raises(InputError, match=message):
        generate("dfs", size, rng)


@pytest.mark.parametrize("size", [5, 7, 13, 21, 63])
def test_dfs_without_openings_is_a_tree(size):
    maze = Maze(dfs_walls(size, np.random.default_rng(1), openings=0))
    num_lattice_cells = (size // 2) ** 2
    assert not maze.walls[1::2, 1::2].any()
    assert maze.walls[::2, ::2].all()
    # A connected graph of n cells is a tree exactly if it has n - 1 edges; an edge is a passage of one cell.
    assert len(maze.free_cells) == num_lattice_cells + (num_lattice_cells - 1)


def test_dfs_opens_a_tenth_of_the_walls():
    rng = np.random.default_rng(2)
    num_passages = np.array([(~dfs_walls(21, rng)).sum() - 100 for _ in range(200)])
    # 180 walls lie between the 100 cells, 99 are passages of the tree, and a tenth of the other 81 is opened.
    expected, deviation = 99 + 0.1 * 81, np.sqrt(81 * 0.1 * 0.9 / 200)
    assert abs(num_passages.mean() - expected) < 4 * deviation


def test_mazes_of_13_cells_mostly_have_3_to_6_landmarks():
    rng = np.random.default_rng(0)
    spec = make_spec("hierarchical", maps=[generate("dfs", 13, rng) for _ in range(300)], landmark_distance=5)
    num_landmarks = []
    for index, maze in enumerate(spec.mazes):
        episode = Episode(index, *corner_cells(maze), yaw=0.0, seed=0)
        num_landmarks.append(
            len(plan_route(spec, episode, show_map(spec, episode)).cells) - 2
        )  # but for start and goal
    assert np.isin(num_landmarks, [3, 4, 5, 6]).mean() >= 0.85


@pytest.mark.parametrize(
    ("text", "start", "goal"),
    [
        (DFS_7_OF_SEED_0, (1, 5), (5, 1)),
        # The corners' own cells are walls: of the free cells equally near, the first in reading order.
        ("######\n#...##\n#....#\n##...#\n###..#\n######", (1, 3), (2, 1)),
        ("#####\n#####\n##.##\n#####\n#####", (2, 2), (2, 2)),
    ],
)
def test_corner_cells_worked_by_hand(text, start, goal):
    assert corner_cells(parse_maze(text)) == (start, goal)
