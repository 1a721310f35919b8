"""The track `stale`: what may move between the shown map and the world, and how it is drawn."""

from __future__ import annotations

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies

import mazebench
from mazebench.errors import InputError
from mazebench.maps.kinds import generate
from mazebench.maps.kinds.dfs import dfs_walls
from mazebench.maps.maze import Maze
from mazebench.tasks.shown_map import show_map
from mazebench.tasks.tracks.stale import SWAPS, is_blocked, move_doors

SIZES = (9, 13, 21)

few = hypothesis.settings(max_examples=40, deadline=None)
seeds = strategies.integers(0, 2**32)


def grid(*lines: str) -> np.ndarray:
    return np.array([[character == "#" for character in line] for line in lines])


@few
@hypothesis.given(strategies.sampled_from(SIZES), seeds, strategies.sampled_from(SWAPS[:2]))
def test_as_many_doors_open_as_close_and_nothing_else_changes(size, seed, swaps):
    rng = np.random.default_rng(seed)
    walls = dfs_walls(size, rng)
    try:
        moved = move_doors(walls, swaps, [], rng)
    except InputError:  # a maze of 4 x 4 rooms can have too few walls that may open
        hypothesis.reject()
    assert (moved & ~walls).sum() == (walls & ~moved).sum() == swaps
    rows, columns = np.nonzero(moved != walls)
    assert ((rows + columns) % 2 == 1).all()  # a room and a pillar are an even number of cells from the corner


@few
@hypothesis.given(seeds, strategies.sampled_from(SWAPS))
def test_map_is_a_legal_maze_in_which_start_and_goal_are_free(seed, swaps):
    rng = np.random.default_rng(seed)
    maze = Maze(dfs_walls(13, rng))
    ends = [tuple(map(int, cell)) for cell in rng.choice(maze.free_cells, 2, replace=False)]
    shown = Maze(move_doors(maze.walls, swaps, ends, rng))  # which is connected, or no legal maze
    assert all(shown.is_free(end) for end in ends)


def test_the_map_follows_from_the_random_stream():
    walls = dfs_walls(13, np.random.default_rng(0))
    first, again, other = (move_doors(walls, 6, [], np.random.default_rng(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


def test_each_level_moves_more_doors_of_the_same_episode():
    for level, swaps in enumerate(SWAPS, 1):
        spec = mazebench.load("stale", level=level, seed=0).task.spec
        env = mazebench.load("stale", level=level, seed=0)
        env.reset()
        shown = show_map(spec, env.task.episode)
        assert (shown.walls != spec.mazes[env.task.episode.maze].walls).sum() == 2 * swaps


def test_moving_doors_keeps_the_kind_of_the_maze():
    # Of the rooms of a maze, as many are dead ends, corridors and crossings as before.
    rng = np.random.default_rng(0)
    counts = np.zeros((2, 5))
    for _ in range(300):
        walls = dfs_walls(13, rng)
        for index, grid_ in enumerate((walls, move_doors(walls, 12, [], rng))):
            free = ~grid_
            doors = free[:-2:2, 1::2].astype(int) + free[2::2, 1::2] + free[1::2, :-2:2] + free[1::2, 2::2]
            counts[index] += np.bincount(doors.ravel(), minlength=5)
    share = counts / counts.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(share[1], share[0], atol=0.02)


class TestBlocked:
    WALLS = grid("#######", "#     #", "# ### #", "# #   #", "# # ###", "# #   #", "#######")

    def test_a_path_through_a_new_wall_is_blocked(self):
        world = self.WALLS.copy()
        world[1, 2] = True
        assert is_blocked(world, self.WALLS, ((1, 1), (1, 5)))

    def test_a_path_beside_a_new_wall_is_not(self):
        world = self.WALLS.copy()
        world[2, 1] = True
        assert not is_blocked(world, self.WALLS, ((1, 1), (1, 5)))


class TestRefusal:
    @pytest.mark.parametrize("kind", ["rooms", "obstacles"])
    def test_a_maze_of_another_kind_is_refused(self, kind):
        maze = generate(kind, 13, np.random.default_rng(0))
        with pytest.raises(InputError, match=r"track 'stale' needs a maze of corridors"):
            mazebench.load("stale", maps=maze, distances=[3])

    def test_a_maze_with_too_few_doors_is_refused(self):
        maze = Maze(dfs_walls(5, np.random.default_rng(0)), "tiny")
        with pytest.raises(InputError, match=r"^tiny: track 'stale' needs 3 doors that can move, found 1$"):
            mazebench.load("stale", maps=maze, distances=[2])
