"""When the next landmark comes and when an episode ends, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from mazebench.maps.maze import Maze
from mazebench.tasks.episode import Episode, Event, Route, ShownMap
from mazebench.tasks.spec import TaskSpec

START, FIRST, SECOND, GOAL, ELSEWHERE = (1, 1), (1, 3), (1, 5), (1, 7), (2, 2)


def local_route(time_limit: int = 10) -> Route:
    return Route([START, GOAL], time_limit)


def hierarchical_route(time_limit: int = 10) -> Route:
    return Route([START, FIRST, SECOND, GOAL], time_limit)


class TestLocalRoute:
    def test_leg_when_new(self):
        route = local_route()
        assert (route.start, route.target, route.goal, route.leg, route.deadline) == (START, GOAL, GOAL, 0, 10)

    def test_event_when_under_way(self):
        route = local_route()
        assert [route.advance(ELSEWHERE, step) for step in range(1, 10)] == [Event.NONE] * 9
        assert route.leg == 0

    def test_event_when_goal_is_reached(self):
        assert local_route().advance(GOAL, 3) is Event.REACHED

    def test_event_when_time_is_out(self):
        assert local_route().advance(ELSEWHERE, 10) is Event.TIMEOUT

    def test_event_when_goal_is_reached_on_the_last_step(self):
        assert local_route().advance(GOAL, 10) is Event.REACHED

    def test_event_when_time_limit_is_one_step(self):
        assert local_route(time_limit=1).advance(START, 1) is Event.TIMEOUT

    def test_event_when_start_is_goal(self):
        assert Route([START, START], 10).advance(START, 1) is Event.REACHED


class TestHierarchicalRoute:
    def test_leg_when_landmark_is_reached(self):
        route = hierarchical_route()
        assert route.advance(FIRST, 4) is Event.LANDMARK
        assert (route.start, route.target, route.goal, route.leg) == (FIRST, SECOND, GOAL, 1)
        assert route.deadline == 14

    def test_leg_when_landmark_times_out(self):
        # The next pair stands at the landmark that was missed, not where the body is.
        route = hierarchical_route()
        assert route.advance(ELSEWHERE, 10) is Event.LANDMARK
        assert (route.start, route.target, route.leg, route.deadline) == (FIRST, SECOND, 1, 20)

    def test_leg_when_landmark_is_reached_on_the_last_step(self):
        # One landmark is done, not two.
        route = hierarchical_route()
        assert route.advance(FIRST, 10) is Event.LANDMARK
        assert (route.leg, route.deadline) == (1, 20)

    def test_event_when_driving_over_all_landmarks(self):
        route = hierarchical_route()
        cells = [ELSEWHERE, FIRST, ELSEWHERE, SECOND, ELSEWHERE, GOAL]
        events = [route.advance(cell, step) for step, cell in enumerate(cells, 1)]
        landmark, none = Event.LANDMARK, Event.NONE
        assert events == [none, landmark, none, landmark, none, Event.REACHED]

    def test_event_when_standing_still(self):
        route = hierarchical_route(time_limit=3)
        events = [route.advance(START, step) for step in range(1, 10)]
        none, landmark = Event.NONE, Event.LANDMARK
        assert events == [none, none, landmark, none, none, landmark, none, none, Event.TIMEOUT]

    def test_event_when_passing_a_later_landmark(self):
        route = hierarchical_route()
        assert route.advance(SECOND, 2) is Event.NONE
        assert route.leg == 0

    def test_event_when_goal_is_entered_on_the_way_to_a_landmark(self):
        assert hierarchical_route().advance(GOAL, 2) is Event.REACHED

    def test_event_when_goal_is_entered_as_a_landmark_times_out(self):
        assert hierarchical_route().advance(GOAL, 10) is Event.REACHED

    def test_event_when_goal_is_reached_on_the_very_last_step(self):
        route = hierarchical_route()
        for step in (10, 20):
            assert route.advance(ELSEWHERE, step) is Event.LANDMARK
        assert route.advance(GOAL, 30) is Event.REACHED


class TestSeveralGoals:
    def test_leg_when_first_goal_is_reached(self):
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

    def test_leg_when_first_goal_times_out(self):
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
    def test_landmarks_when_every_k_cells(self, every, columns):
        assert self.cells(every, (1, 1), (1, 7)) == [(1, column) for column in columns]

    @pytest.mark.parametrize("every", [3, 4, 5])
    def test_landmarks_when_path_is_no_longer_than_k(self, every):
        assert self.cells(every, (1, 4), (1, 1)) == [(1, 4), (1, 1)]

    def test_landmarks_when_task_is_local(self):
        assert self.cells(1, (1, 1), (1, 7), task="local") == [(1, 1), (1, 7)]

    def cells(self, every: int, start, goal, task: str = "hierarchical") -> list[tuple[int, int]]:
        walls = np.ones((9, 9), dtype=bool)
        walls[1, 1:8] = False
        spec = TaskSpec(task, (Maze(walls),), landmark_distance=every)
        episode = Episode(0, start, goal, 0.0, 0)
        return spec.route(episode, spec.show(episode)).cells


class TestStreams:
    def test_streams_when_drawn_again(self):
        first, again = (self.draws(seed=5) for _ in range(2))
        np.testing.assert_array_equal(first, again)

    def test_streams_when_compared_with_each_other_and_another_seed(self):
        draws = np.concatenate([self.draws(seed=5), self.draws(seed=6)])
        assert len(np.unique(draws)) == draws.size

    def test_streams_when_one_is_used_up(self):
        episode = Episode(0, START, GOAL, 0.0, 5)
        streams = episode.streams()
        streams[0].random(1000)
        np.testing.assert_array_equal(streams[2].random(10), episode.streams()[2].random(10))

    def draws(self, seed: int) -> np.ndarray:
        return np.array([stream.random(10) for stream in Episode(0, START, GOAL, 0.0, seed).streams()])


class TestShownMap:
    def test_walls_when_nothing_is_transformed(self):
        walls = np.eye(5, dtype=bool)
        assert ShownMap(walls).seen_walls() is walls

    def test_walls_when_moved_by_a_cell(self):
        walls = np.zeros((5, 5), dtype=bool)
        walls[1, 2] = True
        right_and_down = np.array([[1, 0, 1], [0, 1, 1], [0, 0, 1]], dtype=float)  # of (column, row)
        seen = ShownMap(walls, right_and_down).seen_walls()
        expected = np.zeros((5, 5), dtype=bool)
        expected[0] = expected[:, 0] = expected[2, 3] = True  # outside is wall
        np.testing.assert_array_equal(seen, expected)
