"""Changed buildings: passages, a robot that believes its map, and changes up to a strength."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import re

import numpy as np
import pytest
import scipy
from hypothesis import given, settings
from hypothesis import strategies as st

from mazebench.constants import ON_TIME
from mazebench.errors import InputError
from mazebench.maps.changes import LATE, LATE_WITHOUT_MAP, SIGHT, Change, change, changed, changed_buildings, draw_pairs
from mazebench.maps.follower import follow
from mazebench.maps.kinds import KINDS, generate
from mazebench.maps.maze import Maze
from mazebench.maps.maze_files import read_located
from mazebench.maps.passages import find_passages
from mazebench.maps.readers.ros import write_ros_map
from mazebench.maps.text import parse_maze

KINDS_WITH_ROOMS = ("dfs", "house", "rooms", "office", "hospital", "museum")
# A way through the middle, and one around it.
DEAD_END = """\
#########
#.......#
#.#####.#
#.#...#.#
#.#.#.#.#
#.#.#.#.#
#...#...#
#.#####.#
#########
"""
DEAD_END_PAIRS = np.array([[6 * 9 + 1, 6 * 9 + 7]])  # the lower corners


@functools.cache
def plan_of(kind: str, size: int = 21, seed: int = 0) -> Maze:
    return generate(kind, size, np.random.default_rng(seed))


@functools.cache
def change_of(kind: str, strength: int) -> tuple[Maze, Change]:
    return change(plan_of(kind), strength, np.random.default_rng(0), "new")


def wall_with_openings(*columns: int, thickness: int = 1) -> np.ndarray:
    walls = np.ones((40, 40), bool)
    walls[1:-1, 1:-1] = False
    walls[20 : 20 + thickness] = True
    walls[20 : 20 + thickness, columns] = False
    return walls


class TestPassages:
    def test_passages_lead_from_above_to_below_and_from_left_to_right(self):
        assert find_passages(wall_with_openings(5), 1.0) == ((20, 5, 21, 6, True), (20, 22, 21, 23, False))
        assert find_passages(wall_with_openings(5).T, 1.0) == ((5, 20, 6, 21, True), (22, 20, 23, 21, False))

    @pytest.mark.parametrize(("thickness", "doors"), [(1, [(20, 20, 21, 21, False)]), (2, [])])
    def test_a_door_can_be_opened_in_the_middle_of_a_wall_of_up_to_1_m(self, thickness, doors):
        walls = wall_with_openings(2, thickness=thickness)
        assert [passage for passage in find_passages(walls, 1.0) if not passage.is_open] == doors

    @given(st.sampled_from(sorted(KINDS)), st.integers(0, 1000))
    @settings(max_examples=20, deadline=None)
    def test_halving_the_cells_finds_the_same_passages(self, kind, seed):
        walls = plan_of(kind, 21, seed).walls
        halved = find_passages(np.kron(walls, np.ones((2, 2), bool)), 0.5)
        assert {(*(2 * side for side in box), is_open) for *box, is_open in find_passages(walls, 1.0)} == set(halved)

    @pytest.mark.parametrize(("width", "is_passage"), [(6, True), (7, False)])
    def test_an_open_passage_is_at_most_2_4_m_wide(self, width, is_passage):
        passages = find_passages(wall_with_openings(*range(5, 5 + width)), 0.4)
        assert ((20, 5, 21, 5 + width, True) in passages) == is_passage

    @pytest.mark.parametrize(("other_door", "is_passage"), [(8, False), (9, True)])
    def test_the_sides_of_a_passage_are_at_least_6_m_apart_by_any_other_way(self, other_door, is_passage):
        # From a corner of the door to the other one, through a wall of 1 m, and back: 5 m, or 7 m.
        assert ((20, 5, 21, 6, True) in find_passages(wall_with_openings(5, other_door), 1.0)) == is_passage


class TestFollower:
    @given(st.sampled_from(sorted(KINDS)), st.integers(0, 1000))
    @settings(max_examples=20, deadline=None)
    def test_on_the_right_map_the_robot_drives_the_shortest_way(self, kind, seed):
        maze = plan_of(kind, 21, seed)
        pairs = draw_pairs(maze, 20, np.random.default_rng(seed))
        cells, driven, shortest, _ = follow(maze.walls, maze.walls, pairs, SIGHT, most=2)
        distances = [maze.distance(divmod(start, maze.size), divmod(goal, maze.size)) for start, goal in pairs.tolist()]
        assert driven.tolist() == shortest.tolist() == distances
        assert cells[np.cumsum(driven + 1) - 1].tolist() == pairs[:, 1].tolist()

    @pytest.mark.parametrize(("sight", "turned_after"), [(SIGHT, 7), (1, 9)])
    def test_a_passage_that_is_closed_costs_the_way_there_and_back(self, sight, turned_after):
        plan = parse_maze(DEAD_END)
        walls = plan.walls.copy()
        walls[6, 5] = True
        # The way on the map is 12 cells long. After 7 of them, a robot that sees far looks around the corner at (3, 5).
        _, driven, shortest, _ = follow(walls, plan.walls, DEAD_END_PAIRS, sight, most=9)
        assert (driven, shortest) == ([turned_after + turned_after + 16], [16])

    def test_where_the_map_shows_no_way_the_robot_finds_one(self):
        plan = parse_maze(DEAD_END)
        shown = plan.walls.copy()
        shown[:, 4] = True
        _, driven, shortest, _ = follow(plan.walls, shown, DEAD_END_PAIRS, SIGHT, most=9)
        assert shortest <= driven < 9 * shortest

    @given(st.sampled_from(sorted(KINDS)), st.integers(0, 1000), st.booleans())
    @settings(max_examples=40, deadline=None)
    def test_what_changes_outside_of_its_box_changes_nothing_of_a_drive(self, kind, seed, has_map):
        maze, rng = plan_of(kind, 41, seed % 3), np.random.default_rng(seed)
        pairs = draw_pairs(dataclasses.replace(maze, cell_size=4.0), 5, rng)
        shown = maze.walls if has_map else np.zeros_like(maze.walls)
        walls = maze.walls | (rng.random(maze.walls.shape) < 0.02)
        walls.ravel()[pairs] = False
        joined, _ = scipy.ndimage.label(~walls)
        pairs = pairs[joined.ravel()[pairs[:, 0]] == joined.ravel()[pairs[:, 1]]]
        before = follow(walls, shown, pairs, SIGHT, ON_TIME[0])
        for number, (top, bottom, left, right) in enumerate(before.boxes):
            changed = rng.random(walls.shape) < 0.5
            changed[max(0, top) : bottom + 1, max(0, left) : right + 1] = False
            changed[[0, -1]] = changed[:, [0, -1]] = False
            after = follow(walls ^ changed, shown, pairs[number : number + 1], SIGHT, ON_TIME[0])
            assert (after.driven, after.shortest) == (before.driven[number], before.shortest[number])
            assert (after.boxes == before.boxes[number]).all()


class TestChanges:
    @pytest.mark.parametrize("kind", KINDS_WITH_ROOMS)
    def test_changes_of_a_strength_begin_with_those_of_a_smaller_one(self, kind):
        # The border of a Maze is closed and its free cells are joined.
        plan, (first, before), (second, after) = plan_of(kind), change_of(kind, 1), change_of(kind, 2)
        assert (second.size, second.cell_size, second.kind) == (plan.size, plan.cell_size, kind)
        assert (second.walls == first.walls)[first.walls != plan.walls].all()
        assert after.done[: len(before.done)] == before.done
        assert after.late > before.late
        assert (second.walls & ~plan.walls).any() == bool({"closed", "added"} & set(after.done))
        assert (plan.walls & ~second.walls).any() == bool({"opened", "removed"} & set(after.done))

    def test_the_same_seed_gives_the_same_bytes(self):
        building, found = change(plan_of("house"), 2, np.random.default_rng(0), "new")
        assert (building, str(found)) == (change_of("house", 2)[0], str(change_of("house", 2)[1]))
        assert hashlib.sha256(np.packbits(building.walls).tobytes()).hexdigest()[:16] == "6a7abd4316852fca"

    @pytest.mark.parametrize("strength", [1, 2, 3])
    def test_other_episodes_are_late_as_often_as_the_strength_says(self, strength):
        plan, (building, found) = plan_of("house"), change_of("house", strength)
        pairs = draw_pairs(plan, 300, np.random.default_rng(7))
        pairs = pairs[~building.walls.ravel()[pairs].any(axis=1)]
        _, driven, shortest, _ = follow(building.walls, plan.walls, pairs, SIGHT, ON_TIME[0])
        assert (driven > ON_TIME[0] * shortest).mean() == pytest.approx(LATE[strength - 1], abs=0.07)
        assert found.late_without_map >= LATE_WITHOUT_MAP

    def test_a_strength_that_is_not_reached_is_refused_with_the_number(self):
        walls = np.ones((25, 25), bool)
        walls[1, 1:24] = walls[1:24, 1] = walls[23, 1:24] = walls[1:24, 23] = walls[12, 1:24] = walls[1:24, 12] = False
        with pytest.raises(InputError, match=r"^eight: expected .* found 0\.\d\d with it and 0\.\d\d without$"):
            changed(Maze(walls, "eight"), 3, np.random.default_rng(0))

    @pytest.mark.parametrize(("strength", "rng"), [(4, np.random.default_rng(0)), (1, 0)])
    def test_what_is_no_strength_or_generator_is_refused(self, strength, rng):
        with pytest.raises(InputError, match=r"^expected (a strength of 1 to 3|rng as a numpy)"):
            changed(plan_of("house"), strength, rng)


class TestCommand:
    def test_changed_buildings_lie_in_the_frame_of_the_plan_and_do_not_depend_on_their_number(self, command, tmp_path):
        plan = dataclasses.replace(plan_of("house", 31), cell_size=0.5)
        write_ros_map(plan, tmp_path / "plan.yaml", (-3.25, 7.5, 0.4))
        asked = "generate --mazes plan.yaml --changed 1 --count 2 --seed 5 --format ros,txt --out new"
        status, output, _ = command(*asked.split())
        assert status == 0
        first, second = (read_located(tmp_path / "new" / f"plan-changed-{number}.yaml") for number in (1, 2))
        assert (first.maze,) == changed_buildings(plan, 1, 1, seed=5)
        assert first.maze != second.maze
        assert first.origin == second.origin == (-3.25, 7.5, 0.4)
        assert "\nplan-changed-2: " in output

    def test_drawn_mazes_change_too_and_a_refusal_is_one_line(self, command, tmp_path):
        asked = "generate --changed 2 --format txt --kind"
        status, output, errors = command(*asked.split(), "house", "--size", "21")
        assert (status, errors) == (0, "")
        assert (tmp_path / "mazes" / "house-21-0-000-changed-1.txt").exists()
        assert "passages closed" in output
        status, output, errors = command(*asked.split(), "cave", "--size", "31")
        assert status == 2
        assert re.fullmatch(r"mazebench: cave-31-0-000: expected a building in which .* found 0\.0\d\n", errors)
