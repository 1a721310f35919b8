"""The moments of the next landmark and of the end of an episode, by hand."""

from __future__ import annotations

import numpy as np
import pytest
from simple_mazes import corridor

from mazebench.tasks.episode import Episode
from mazebench.tasks.perturbations.flip_warp_noise import Perspective
from mazebench.tasks.perturbations.perturbation import ShownMap
from mazebench.tasks.route import Event, Route, plan_route
from mazebench.tasks.shown_map import show_map
from mazebench.tasks.task import Task

START, FIRST, SECOND, GOAL, ELSEWHERE = (1, 1), (1, 3), (1, 5), (1, 7), (2, 2)


def hierarchical_route(time_limit: int = 10) -> Route:
    return Route([START, FIRST, SECOND, GOAL], time_limit)


@pytest.mark.parametrize(
    ("cell", "step", "event"),
    [(ELSEWHERE, 9, Event.NONE), (GOAL, 3, Event.REACHED), (GOAL, 10, Event.REACHED), (ELSEWHERE, 10, Event.TIMEOUT)],
)
def test_a_local_episode_ends_at_the_goal_or_when_time_is_out(cell, step, event):
    route = Route([START, GOAL], time_limit=10)
    assert (route.start, route.target, route.goal, route.leg, route.deadline) == (START, GOAL, GOAL, 0, 10)
    assert route.advance(cell, step) is event


class TestHierarchicalRoute:
    def test_a_leg_begins_where_a_landmark_is_reached(self):
        route = hierarchical_route()
        assert route.advance(FIRST, 4) is Event.LANDMARK
        assert (route.start, route.target, route.goal, route.leg) == (FIRST, SECOND, GOAL, 1)
        assert route.deadline == 14

    def test_a_leg_begins_at_a_landmark_that_was_missed(self):
        # The next pair stands at the landmark that was missed, not where the body is.
        route = hierarchical_route()
        assert route.advance(ELSEWHERE, 10) is Event.LANDMARK
        assert (route.start, route.target, route.leg, route.deadline) == (FIRST, SECOND, 1, 20)

    def test_a_body_that_stands_still_gets_all_legs(self):
        route = hierarchical_route(time_limit=3)
        events = [route.advance(START, step) for step in range(1, 10)]
        none, landmark = Event.NONE, Event.LANDMARK
        assert events == [none, none, landmark, none, none, landmark, none, none, Event.TIMEOUT]

    def test_a_later_landmark_does_not_count(self):
        route = hierarchical_route()
        assert route.advance(SECOND, 2) is Event.NONE
        assert route.leg == 0

    def test_a_goal_entered_on_the_way_to_a_landmark_counts(self):
        assert hierarchical_route().advance(GOAL, 2) is Event.REACHED


class TestSeveralGoals:
    def test_another_goal_follows_one_that_is_reached(self):
        asked = []

        def next_goal(cell):
            asked.append(cell)
            return SECOND

        route = Route([START, GOAL], 10, 2, next_goal)
        assert route.advance(GOAL, 4) is Event.LANDMARK
        assert (route.start, route.target, route.goal, route.deadline) == (GOAL, SECOND, SECOND, 14)
        assert asked == [GOAL]
        assert route.advance(GOAL, 5) is Event.NONE
        assert route.advance(SECOND, 6) is Event.REACHED

    def test_another_goal_follows_one_that_is_missed(self):
        # Other than a landmark, a drawn goal lies at a wanted distance from where the body is.
        route = Route([START, GOAL], 10, 2, lambda cell: SECOND)
        assert route.advance(ELSEWHERE, 10) is Event.LANDMARK
        assert (route.start, route.target, route.deadline) == (ELSEWHERE, SECOND, 20)
        assert route.advance(ELSEWHERE, 20) is Event.TIMEOUT


class TestLandmarks:
    """A corridor of 7 cells from (1, 1) to (1, 7), 6 cells long."""

    @pytest.mark.parametrize(
        ("every", "columns"),
        [(1, [1, 2, 3, 4, 5, 6, 7]), (2, [1, 3, 5, 7]), (3, [1, 4, 7]), (4, [1, 5, 7]), (5, [1, 6, 7])],
    )
    def test_landmarks_stand_every_k_cells(self, every, columns):
        assert self.cells(every, (1, 1), (1, 7)) == [(1, column) for column in columns]

    def test_a_local_task_has_no_landmark(self):
        assert self.cells(1, (1, 1), (1, 7), task="local") == [(1, 1), (1, 7)]

    def cells(self, every: int, start, goal, task: str = "hierarchical") -> list[tuple[int, int]]:
        spec = Task.of(task, mazes=corridor(), landmark_distance=every)
        episode = Episode(0, start, goal, 0.0, 0)
        return plan_route(spec, episode, show_map(spec, episode)).cells


class TestStreams:
    def test_streams_differ_from_each_other_and_from_another_seeds(self):
        draws = np.concatenate([self.draws(seed=5), self.draws(seed=6)])
        assert len(np.unique(draws)) == draws.size

    def test_streams_are_children_of_the_seed(self):
        children = np.random.SeedSequence(5).spawn(7)
        for index, child in enumerate(children):
            expected = np.random.default_rng(child).random(10)
            np.testing.assert_array_equal(Episode(0, START, GOAL, 0.0, 5).stream(index).random(10), expected)

    def draws(self, seed: int) -> np.ndarray:
        return np.array([Episode(0, START, GOAL, 0.0, seed).stream(index).random(10) for index in range(4)])


class TestShownMap:
    def test_a_map_that_is_not_transformed_shows_its_walls(self):
        walls = np.eye(5, dtype=bool)
        assert ShownMap(walls).seen_walls() is walls

    def test_a_map_moved_by_a_cell_has_walls_coming_in(self):
        walls = np.zeros((5, 5), dtype=bool)
        walls[1, 2] = True
        right_and_down = np.array([[1, 0, 1], [0, 1, 1], [0, 0, 1]], dtype=float)  # of (column, row)
        seen = ShownMap(walls, Perspective(right_and_down)).seen_walls()
        expected = np.zeros((5, 5), dtype=bool)
        expected[0] = expected[:, 0] = expected[2, 3] = True  # outside is wall
        np.testing.assert_array_equal(seen, expected)
