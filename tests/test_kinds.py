"""Kinds of mazes: legal, seeded, and those of depth-first search as hard as the paper's."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest
from scipy import ndimage

from mazebench.errors import InputError
from mazebench.maps.kinds import CHECK, KINDS, KNOWN, NOVEL, generate
from mazebench.maps.kinds.dfs import dfs_walls
from mazebench.maps.maze import Maze, corner_cells
from mazebench.maps.text import format_maze, parse_maze

DFS_7_OF_SEED_0 = """\
#######
#...#.#
#.#.#.#
#.#...#
#.###.#
#...#.#
#######
"""


# SHA-256 of the text of a maze of 31 x 31 cells of seed 0: frozen mazes are drawn again from seeds.
GOLDEN = {
    "dfs": "1b5bb57d11b3f25e840a4a7b6c169b96a358d8a017f335cec4f494d090de0ba6",
    "house": "13e331fdde6f148a801da49c2970df7100524a9ba7196fb8bad0c9ba674b9925",
    "rooms": "8005af538f29fc3f09c4a6c9b46083918d53dba19d6f86a894caf470c97b0419",
    "office": "2d7e57284e9167bdb4d07b78bd2f60943ab8ac3cbc4761ceee2d3690176b6a03",
    "hospital": "88a7af12fca05dcc628e7101133e9d824a7586668c02160047dd517ddefa661a",
    "museum": "46583547102e9a9d2447fa969a57105a387dfc7f45d6a2bfb474fc9cb8581d0e",
    "obstacles": "9d139b1094d443cde14ecae3e6ba482979a8f0556052fb47226e7606a9ede5aa",
    "cave": "72e76120fb44d61bbe2882fd45ce77715bde145e9fe1f160fb8512acd8b9bc9b",
    "warehouse": "5c4a8a18c6ad874629377c0cecacf40b409fc55a521d7fdc5ff6764ba47dae65",
}
LATTICE = ("dfs", "rooms")
SMALL = ("dfs", "obstacles", "rooms")
BUILDINGS = sorted(set(KINDS) - set(SMALL))


def sizes(kind: str) -> list[int]:
    """From the smallest to the largest."""
    some = [5, 7, 9] if kind in SMALL else []
    return [*some, 13, 21, 31, 51, 63, 255] if kind in LATTICE else [*some, 13, 14, 20, 21, 30, 31, 42, 51, 63, 255]


@pytest.mark.parametrize("kind", KINDS)
class TestEveryKind:
    def test_mazes_of_all_sizes_are_legal(self, kind):
        for size in sizes(kind):
            for seed in range(20 if size <= 51 else 1):
                # The constructor of Maze refuses what is not legal.
                maze = generate(kind, size, np.random.default_rng(seed))
                assert (maze.size, maze.kind, maze.name) == (size, kind, f"{kind}-{size}")

    def test_a_maze_of_seed_0_stays_as_it_is(self, kind):
        text = format_maze(generate(kind, 31, np.random.default_rng(0)))
        assert hashlib.sha256(text.encode()).hexdigest() == GOLDEN[kind]


@pytest.mark.parametrize(
    ("kind", "size", "message"),
    [
        *(("obstacles", size, f"expected a size of 5 to 1024 cells, found {size}") for size in (-1, 4, 1025)),
        *((kind, 14, f"kind '{kind}' makes mazes of odd sizes only, found size 14") for kind in LATTICE),
        *((kind, 12, f"kind '{kind}' makes mazes of 13 cells and more, found size 12") for kind in BUILDINGS),
        ("dfs", "13", "expected a size of 5 to 1024 cells, found '13'"),
        ("spiral", 13, f"unknown kind 'spiral'; available: {', '.join(sorted(KINDS))}"),
    ],
)
def test_what_no_kind_makes_is_refused(kind, size, message):
    with pytest.raises(InputError, match=f"^{message}$"):
        generate(kind, size, np.random.default_rng(0))


def test_anything_but_a_generator_is_refused():
    with pytest.raises(InputError, match=r"expected rng as a numpy\.random\.Generator, found int"):
        generate("dfs", 13, 0)


def test_every_kind_is_in_one_group():
    assert sorted(KNOWN + NOVEL + CHECK) == sorted(KINDS)


@pytest.mark.parametrize("kind", KNOWN + NOVEL)
def test_pairs_of_up_to_40_cells_are_in_nearly_every_maze_of_31_cells(kind):
    rng = np.random.default_rng(0)
    assert np.mean([generate(kind, 31, rng).diameter >= 40 for _ in range(20)]) >= 0.9


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
