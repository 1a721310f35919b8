"""Trouble spots in buildings in which one can say by hand where a way is closed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from made_results import make_record
from simple_mazes import field

from mazebench.maps.maze import Maze
from mazebench.maps.older_map import OlderMap
from mazebench.results.trouble import CLOSED, DETOUR, OPENED, find_spots


def two_rooms(*doors: int) -> np.ndarray:
    """Returns a room left and a room right of a wall in column 10 of 21, with doors in these rows."""
    walls = field(21).walls.copy()
    walls[:, 10] = True
    walls[list(doors), 10] = False
    return walls


def spots_of(shown, built, trips, lost, drives=None, **place):
    older = OlderMap(shown, Maze(built, "rooms", cell_size=place.pop("cell_size", 1.0)), **place)
    records = [make_record(i, maze="rooms", size=21, start=s, goal=g) for i, (s, g) in enumerate(trips)]
    return find_spots(records, np.array(lost), [older], drives or [(np.zeros((1, 2)),) * 2] * len(trips))


LEFT, RIGHT = (5, 5), (5, 15)


def test_a_closed_door_is_named_with_its_trips():
    trips = [(LEFT, RIGHT), (RIGHT, LEFT), ((1, 1), (9, 9)), ((5, 2), (5, 18))]
    [spot] = spots_of(two_rooms(5, 19), two_rooms(19), trips, [20.0, 24.0, 0.4, 21.0])
    assert spot.kind == CLOSED
    assert spot.cell == (5, 10)
    assert spot.point == (10.5, 15.5)  # of 21 m: row 5 from above
    assert spot.trips == (1, 3, 0)  # the one that loses most first; the third stays in its room
    assert spot.metres == 65.0


def test_a_new_door_is_named_where_the_map_has_a_wall():
    [spot] = spots_of(two_rooms(19), two_rooms(5, 19), [(LEFT, RIGHT)], [12.0])
    assert (spot.kind, spot.cell, spot.metres) == (OPENED, (5, 10), 12.0)


def test_points_are_in_the_frame_of_the_map():
    shape = {"origin": (-3.0, 2.0, math.pi / 2), "cell_size": 0.5}
    [spot] = spots_of(two_rooms(5, 19), two_rooms(19), [(LEFT, RIGHT)], [20.0], **shape)
    assert spot.point == pytest.approx((-3.0 - 15.5 / 2, 2.0 + 10.5 / 2))


def test_of_several_walls_that_with_the_longest_way_around_counts():
    built = two_rooms(19)
    built[5, 6] = True  # a chair on the same way, one step around
    [spot] = spots_of(two_rooms(5, 19), built, [(LEFT, RIGHT)], [20.0])
    assert spot.cell == (5, 10)


def test_without_such_walls_a_trip_counts_where_it_leaves_the_right_way():
    line = np.column_stack([np.linspace(2.5, 8.5, 25), np.full(25, 15.5)])
    aside = line.copy()
    aside[6:18, 1] += [1, 2, 3, 3, 2, 1, 4, 5, 5, 4, 3, 1]  # twice, farther away the second time
    trips = [((5, 2), (5, 8))] * 2
    [spot] = spots_of(two_rooms(5), two_rooms(5), trips, [9.0, 0.1], [(aside, line), (line, line)])
    assert (spot.kind, spot.trips, spot.metres) == (DETOUR, (0,), 9.0)
    assert spot.cell == (4, 5)  # of the 12th point, (5.25, 16.5)


def test_places_within_a_metre_are_one_and_the_worst_comes_first():
    shown, built = two_rooms(3, 5, 16, 19), two_rooms(19)
    trips = [((3, 9), (3, 11)), ((5, 9), (5, 11)), ((16, 9), (16, 11))]
    near, far = spots_of(shown, built, trips, [10.0, 14.0, 30.0])[::-1]
    assert (near.trips, near.cell, near.metres) == ((1, 0), (4, 10), 24.0)
    assert (far.trips, far.cell, far.metres) == ((2,), (16, 10), 30.0)


def test_places_of_two_changes_that_are_two_metres_apart_are_two():
    shown, built = two_rooms(3, 6, 19), two_rooms(19)
    trips = [((3, 9), (3, 11)), ((6, 9), (6, 11))]
    assert [spot.cell for spot in spots_of(shown, built, trips, [10.0, 14.0])] == [(6, 10), (3, 10)]


def test_a_wide_passage_is_one_place():
    doors = range(8, 14)
    trips = [((7, 9), (7, 11)), ((14, 9), (14, 11))]  # through its upper and through its lower side
    [spot] = spots_of(two_rooms(*doors, 19), two_rooms(19), trips, [20.0, 30.0], cell_size=0.5)
    assert (spot.trips, spot.cell) == ((1, 0), (10.5, 10))


def test_a_map_that_is_right_has_no_trouble():
    assert spots_of(two_rooms(5), two_rooms(5), [(LEFT, RIGHT)], [0.3]) == []
