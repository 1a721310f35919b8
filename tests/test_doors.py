"""Doors: where they may be, and maps on which some have moved."""

from __future__ import annotations

import numpy as np
import pytest

from mazebench.errors import InputError
from mazebench.maps.doors import door_slots, num_swappable, swap_doors
from mazebench.maps.kinds import KINDS, KNOWN, NOVEL, generate
from mazebench.maps.maze import Maze
from mazebench.maps.text import parse_maze

WITH_DOORS = KNOWN + NOVEL
THREE_ROOMS = """\
#########
#...#...#
#...#...#
#...#...#
#.#####.#
#.......#
#.......#
#.......#
#########
"""


def slots_of(maze: Maze) -> set[tuple[int, int]]:
    return set(map(tuple, door_slots(maze).tolist()))


def moved(maze: Maze, num_swaps: int, seed: int, keep=()) -> Maze:
    rng = np.random.default_rng(seed)
    return Maze(swap_doors(maze.walls, maze.kind, num_swaps, keep, rng), "map", kind=maze.kind)


def num_rooms_by_doors(maze: Maze) -> np.ndarray:
    """Counts the rooms of a maze of corridors that have 0, 1, 2, 3 and 4 open doors."""
    free = (~maze.walls).astype(int)
    doors = free[:-2, 1:-1] + free[2:, 1:-1] + free[1:-1, :-2] + free[1:-1, 2:]
    return np.bincount(doors[::2, ::2].ravel(), minlength=5)


class TestSlots:
    def test_slots_worked_by_hand(self):
        # (4, 2) is no slot: with the open (4, 1) beside it, it would be a hole of two cells.
        assert slots_of(parse_maze(THREE_ROOMS)) == {(1, 4), (2, 4), (3, 4), (4, 1), (4, 3), (4, 5), (4, 7)}

    def test_slots_of_a_maze_of_corridors_are_the_cells_between_two_rooms(self):
        maze = generate("dfs", 13, np.random.default_rng(0))
        inner = [(row, column) for row in range(1, 12) for column in range(1, 12)]
        assert slots_of(maze) == {cell for cell in inner if sum(cell) % 2}

    def test_a_maze_of_no_kind_has_the_slots_of_any_building(self):
        maze = generate("house", 31, np.random.default_rng(0))
        assert slots_of(Maze(maze.walls)) == slots_of(maze)

    def test_an_unknown_kind_is_refused(self):
        maze = Maze(parse_maze(THREE_ROOMS).walls, kind="pub")
        with pytest.raises(InputError, match=r"^unknown kind 'pub'; available: cave, dfs, "):
            door_slots(maze)


class TestSwaps:
    @pytest.mark.parametrize("kind", WITH_DOORS)
    @pytest.mark.parametrize("num_swaps", [1, 5, 10])
    def test_as_many_doors_are_closed_and_opened_as_asked_for(self, kind, num_swaps):
        for seed in range(10):
            maze = generate(kind, 31, np.random.default_rng(seed))
            keep = [tuple(cell) for cell in door_slots(maze)[~maze.walls[tuple(door_slots(maze).T)]][:8].tolist()]
            shown = moved(maze, num_swaps, seed, keep)  # connected: the constructor of Maze refuses other walls
            opened, closed = maze.walls & ~shown.walls, shown.walls & ~maze.walls
            assert opened.sum() == closed.sum() == num_swaps
            assert not any(shown.walls[cell] for cell in keep)
            cells = {tuple(cell) for cell in np.argwhere(opened | closed).tolist()}
            assert cells <= slots_of(maze)
            assert cells <= slots_of(shown), "a door that has moved is a door on the map, too"

    def test_a_map_does_not_depend_on_those_that_were_drawn_before(self):
        maze = generate("rooms", 31, np.random.default_rng(0))
        first = moved(maze, 10, 0)
        of_no_kind = Maze(maze.walls)
        assert moved(of_no_kind, 10, 0) != first
        assert moved(maze, 10, 1) != first
        assert moved(maze, 10, 0) == first

    def test_doors_that_are_opened_do_not_touch(self):
        for seed in range(20):
            maze = generate("house", 31, np.random.default_rng(seed))
            opened = maze.walls & ~moved(maze, 12, seed).walls
            assert not (opened[1:] & opened[:-1]).any()
            assert not (opened[:, 1:] & opened[:, :-1]).any()

    def test_maps_have_about_as_many_dead_ends_and_crossings_as_mazes(self):
        mazes = [generate("dfs", 31, np.random.default_rng(seed)) for seed in range(20)]
        before = sum(num_rooms_by_doors(maze) for maze in mazes)
        after = sum(num_rooms_by_doors(moved(maze, 32, seed)) for seed, maze in enumerate(mazes))
        assert np.abs(after - before).sum() < 0.1 * before.sum()

    @pytest.mark.parametrize(("kind", "num_swaps"), [("cave", 1), ("dfs", 400), ("house", 100)])
    def test_more_swaps_than_there_are_doors_are_refused(self, kind, num_swaps):
        maze = generate(kind, 31, np.random.default_rng(0))
        assert num_swappable(maze) < num_swaps
        with pytest.raises(InputError, match=rf"^found no map with {num_swaps} doors moved; give a maze that has more"):
            moved(maze, num_swaps, 0)

    def test_the_only_way_that_is_kept_stays(self):
        maze = parse_maze(THREE_ROOMS)
        with pytest.raises(InputError, match=r"^found no map with 1 doors moved"):
            moved(maze, 1, 0, keep=[(4, 1), (4, 7)])

    @pytest.mark.parametrize("kind", KINDS)
    def test_own_maps_of_every_kind_keep_what_is_free(self, kind):
        maze = generate(kind, 31, np.random.default_rng(0))
        assert moved(maze, 0, 0, keep=maze.free_cells.tolist()) == maze
