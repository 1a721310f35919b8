"""The agent believer: its belief over doors, the ways that it compares, and what it reaches."""

from __future__ import annotations

import numpy as np
import pytest
from mazebench_agents.believer.doors import DoorBelief
from mazebench_agents.believer.ways import FREE, UNKNOWN, WALL, cheapest_path, drive, lines_of_sight, look, steps_to

from mazebench.evaluation.evaluate import evaluate
from mazebench.maps.doors import door_slots, swap_doors
from mazebench.maps.kinds import generate

TWO_ROOMS = np.ones((9, 9), dtype=bool)  # on both sides of a door
TWO_ROOMS[1:6, 1:4] = TWO_ROOMS[1:6, 5:8] = False
TWO_ROOMS[3, 4] = False
DOOR = (3, 4)
NO_DOORS = np.full(TWO_ROOMS.shape, -1)


def flat(*cell: int) -> int:
    return cell[0] * len(TWO_ROOMS) + cell[1]


def belief_in(kind: str, seed: int) -> tuple[np.ndarray, DoorBelief, tuple[int, int], tuple[int, int]]:
    maze = generate(kind, 31, np.random.default_rng(seed), "a")
    free = np.argwhere(~maze.walls)
    start, goal = tuple(free[0].tolist()), tuple(free[-1].tolist())
    return maze.walls, DoorBelief(maze.walls, 1.0, start, goal), start, goal


class TestWays:
    def test_steps_lead_around_walls(self):
        steps = steps_to(TWO_ROOMS, flat(1, 7)).reshape(TWO_ROOMS.shape)
        assert steps[1, 7] == 0
        assert steps[1, 1] == 2 + 6 + 2  # down to the door's row, through it, and up

    def test_a_door_is_entered_if_its_price_is_less_than_the_way_around(self):
        walls = TWO_ROOMS.copy()
        walls[5, 4] = False  # a second way, 4 steps longer
        door = NO_DOORS.copy()
        door[DOOR] = 0
        known = np.full(walls.shape, UNKNOWN, np.int8)
        for price, passed in ((3.0, 3), (5.0, 5)):
            path = cheapest_path(known, walls, door, np.array([price]), (3, 3), (3, 5))
            assert flat(passed, 4) in path

    def test_what_is_known_to_be_wall_is_never_entered(self):
        known = np.full(TWO_ROOMS.shape, UNKNOWN, np.int8)
        known[DOOR] = WALL
        path = cheapest_path(known, TWO_ROOMS, NO_DOORS, np.zeros(0), (3, 3), (3, 5))
        assert flat(*DOOR) not in path

    def test_one_sees_to_the_first_wall_within_reach(self):
        known = np.full(TWO_ROOMS.shape, UNKNOWN, np.int8)
        differs = look(TWO_ROOMS, known, TWO_ROOMS, flat(3, 2), lines_of_sight(3.0))
        assert not differs
        assert known[DOOR] == FREE
        assert known[2, 4] == WALL
        assert known[2, 5] == UNKNOWN  # behind the wall
        assert known[3, 7] == UNKNOWN  # 5 m away

    def test_a_drive_turns_back_where_a_door_is_closed(self):
        shown, building = TWO_ROOMS.copy(), TWO_ROOMS.copy()
        shown[5, 4] = building[5, 4] = False
        building[DOOR] = True
        door, prices = NO_DOORS.copy(), np.array([0.3])
        door[DOOR] = 0
        known = np.full(shown.shape, UNKNOWN, np.int8)
        path = cheapest_path(known, shown, door, prices, (3, 1), (3, 7))
        assert len(path) == 7
        for most, steps in ((50.0, 10.0), (3.0, 4.0)):  # through the other door; or given up
            driven = drive(building, known.copy(), shown, door, prices, path, flat(3, 7), most, lines_of_sight(1.0))
            assert driven == steps


class TestDoorBelief:
    @pytest.mark.parametrize("kind", ["dfs", "house", "rooms", "office"])
    def test_it_finds_the_doors_of_a_kind_that_it_is_not_told(self, kind):
        maze = generate(kind, 31, np.random.default_rng(0), "a")
        belief = DoorBelief(maze.walls, 1.0, (1, 1), (1, 1))
        assert set(map(tuple, np.argwhere(belief.number >= 0))) == set(map(tuple, door_slots(maze)))

    @pytest.mark.parametrize("kind", ["dfs", "house", "rooms"])
    def test_buildings_agree_with_what_is_known_and_have_a_way(self, kind):
        shown, belief, start, goal = belief_in(kind, 1)
        true = swap_doors(shown, kind, 7, (start, goal), np.random.default_rng(2))
        known = np.full(shown.shape, UNKNOWN, np.int8)
        known[:, :16] = true[:, :16]
        drawn = belief.draw(known, start, start, goal, 20, 3)
        assert len(drawn.walls) == 20
        assert (drawn.walls[:, :, :16] == true[:, :16]).all()
        for walls, length in zip(drawn.walls, drawn.lengths, strict=True):
            assert steps_to(walls, goal[0] * 31 + goal[1])[start[0] * 31 + start[1]] == length
            assert (walls != shown)[belief.number < 0].sum() == 0  # nothing but doors has changed

    def test_doors_open_and_close_in_pairs(self):
        shown, belief, start, goal = belief_in("house", 1)
        drawn = belief.draw(np.full(shown.shape, UNKNOWN, np.int8), start, start, goal, 20, 3)
        closed = (drawn.walls & ~shown).sum(axis=(1, 2))
        opened = (~drawn.walls & shown).sum(axis=(1, 2))
        assert closed.max() > 0
        np.testing.assert_array_equal(closed, opened)

    def test_a_closed_door_makes_those_near_it_likelier_open(self):
        shown, belief, start, goal = belief_in("house", 1)
        known = np.full(shown.shape, UNKNOWN, np.int8)
        before = belief.draw(known, start, start, goal, 200, 3).closed
        opened, first = next((d, belief.pairs.first[d]) for d in range(len(before)) if not belief.is_open[d]
                             and belief.pairs.first[d + 1] > belief.pairs.first[d])  # fmt: skip
        known[belief.number == belief.pairs.around[first]] = WALL
        after = belief.draw(known, start, start, goal, 200, 3).closed
        assert after[opened] < before[opened]

    def test_the_level_follows_from_the_doors_that_were_seen(self):
        _, belief, _, _ = belief_in("dfs", 0)
        unknown, same = np.full(len(belief.is_open), -1, np.int8), np.zeros(len(belief.is_open), np.int8)
        np.testing.assert_allclose(belief.levels(unknown), 0.25)
        assert belief.levels(same)[0] > 0.99
        changed = same.copy()
        changed[np.flatnonzero(belief.is_open)[:30]] = changed[np.flatnonzero(~belief.is_open)[:30]] = 1
        assert belief.levels(changed)[3] > 0.98

    def test_passages_of_finer_cells_change_on_their_own(self):
        shown = np.kron(TWO_ROOMS, np.ones((2, 2), dtype=bool))
        belief = DoorBelief(shown, 0.5, (6, 4), (6, 12))
        assert belief.number[6, 8] == belief.number[7, 8] >= 0
        assert belief.pairs.opens.sum() == 0

    def test_the_same_seed_draws_the_same_buildings(self):
        shown, belief, start, goal = belief_in("rooms", 4)
        known = np.full(shown.shape, UNKNOWN, np.int8)
        first, again, other = (belief.draw(known, start, start, goal, 5, seed).walls for seed in (1, 1, 2))
        np.testing.assert_array_equal(first, again)
        assert (first != other).any()


class TestBeliever:
    @pytest.mark.parametrize(("track", "level"), [("rebuilt", 3), ("adrift", 1)])
    def test_drives_do_not_depend_on_the_number_of_environments(self, track, level, tmp_path):
        options = {"level": level, "split": "train", "distances": (16,), "episodes_per_distance": 1}
        for envs in (1, 7):
            evaluate("believer", track, **options, num_envs=envs, out=tmp_path / str(envs))
        first, second = ((tmp_path / str(envs) / "episodes.jsonl").read_bytes() for envs in (1, 7))
        assert first == second

    def test_it_is_on_time_where_the_map_is_right(self):
        assert evaluate("believer", "building", split="dev", episodes_per_maze=1).overall.on_time["1.25"] >= 0.95
