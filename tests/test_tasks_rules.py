"""The rule book, fed by hand with poses along a corridor; in one environment and, with the same numbers, in many."""

from __future__ import annotations

import numpy as np
import pytest
from simple_mazes import corridor, field

from mazebench.tasks.episode import Episode, episode_level, sample_episode
from mazebench.tasks.rules import Rules, reward
from mazebench.tasks.shown_map import is_blocked, show_map
from mazebench.tasks.task import Task
from mazebench.tasks.time_limit import default_time_limit
from mazebench.world.bodies import SLIDER

ROW = 1  # of the corridor, whose cells are (1, 1) to (1, 7)
everywhere = pytest.mark.parametrize("num_envs", [1, 3])


def along(start: int, goal: int) -> Episode:
    return Episode(0, (ROW, start), (ROW, goal), yaw=0.0, seed=11)


def begin(num_envs: int, episode: Episode, *options, mazes=None, **named) -> Rules:
    rules = Rules(Task.of(*options, mazes=mazes or corridor(), **named), num_envs)
    for i in range(num_envs):
        rules.begin(i, episode)
    return rules


def drive(rules: Rules, cell: tuple[int, int]) -> tuple[bool, bool, bool]:
    """Steps all bodies into the middle of `cell`; returns whether a leg began, the goal was reached, time was out."""
    num_envs = len(rules.episodes)
    pose = (*rules.task.mazes[0].point(cell), 0.0)
    rules.advance(np.tile(pose, (num_envs, 1)), np.ones(num_envs, dtype=bool))
    happened = np.array([rules.is_first, rules.reached, rules.timed_out])
    assert (happened == happened[:, :1]).all()
    return tuple(happened[:, 0].tolist())


def marked(rules: Rules) -> list[int]:
    """The columns of the start and of the target that the context marks."""
    return [int(np.argwhere(rules.context[0, plane])[0, 1]) for plane in (3, 2)]


class TestLocal:
    @everywhere
    def test_an_episode_ends_with_reward_0_when_the_goal_is_reached(self, num_envs):
        rules = begin(num_envs, along(1, 3))
        np.testing.assert_array_equal(rules.pose, np.tile((1.5, 7.5, 0.0), (num_envs, 1)))
        np.testing.assert_array_equal(rules.marker, np.tile((3.5, 7.5, 0.0), (num_envs, 1)))
        assert drive(rules, (ROW, 2)) == (False, False, False)
        np.testing.assert_array_equal(reward(rules.reached), -1.0)
        assert drive(rules, (ROW, 3)) == (False, True, False)
        np.testing.assert_array_equal(reward(rules.reached), 0.0)
        assert (reward(True), reward(False)) == (0.0, -1.0)

    @everywhere
    def test_time_is_out_unless_the_last_step_reaches_the_goal(self, num_envs):
        rules = begin(num_envs, along(1, 3), time_limit=2)
        assert [drive(rules, (ROW, 2)) for _ in range(2)] == [(False, False, False), (False, False, True)]
        rules = begin(num_envs, along(1, 3), time_limit=2)
        assert [drive(rules, (ROW, column)) for column in (2, 3)][1] == (False, True, False)

    @everywhere
    def test_the_infos_tell_what_was_driven(self, num_envs):
        rules = begin(num_envs, along(1, 7))
        for column in (3, 2, 4):  # 2 + 1 + 2 m
            drive(rules, (ROW, column))
        infos = rules.infos()
        for i in range(num_envs):
            found = {name: np.asarray(values[i]).tolist() for name, values in infos.items()}
            assert found == rules.info(i) | {"position": [4.5, 7.5]}
            assert (found["steps"], found["path_length"], found["success"], found["is_first"]) == (3, 5.0, False, False)

    @everywhere
    def test_the_infos_tell_what_is_left(self, num_envs):
        rules = begin(num_envs, along(3, 7), time_limit=50)
        left = [(rules.info(0)["way_left"], rules.info(0)["steps_left"])]
        for column in (2, 4, 7):
            drive(rules, (ROW, column))
            left.append((rules.info(0)["way_left"], rules.info(0)["steps_left"]))
        assert left == [(4, 50), (5, 49), (3, 48), (0, 47)]
        expected = {"distance": 4, "time_limit": 50, "blocked": False, "kind": "", "track": "", "level": 0}
        assert {name: rules.info(0)[name] for name in expected} == expected

    @everywhere
    def test_progress_is_rewarded_besides_the_steps(self, num_envs):
        rules = begin(num_envs, along(3, 7), reward="progress")
        rewards = []
        for column in (2, 2, 4, 7):
            drive(rules, (ROW, column))
            rewards.append(rules.reward(0))
            np.testing.assert_array_equal(rules.rewards(), np.full(num_envs, rewards[-1], np.float32), strict=True)
        assert rewards == [-1 - 1, -1, -1 + 2, 0 + 3]

    def test_an_environment_without_an_episode_stands_still(self):
        rules = begin(2, along(1, 3))
        rules.begin(1, None)
        np.testing.assert_array_equal(rules.active, [True, False])
        rules.advance(np.tile((3.5, 7.5, 0.0), (2, 1)) - [[0, 0, 0], [2, 0, 0]], rules.active)
        np.testing.assert_array_equal(rules.reached, [True, False])
        np.testing.assert_array_equal(rules.steps, [1, 0])


class TestHierarchical:
    OPTIONS = ("hierarchical",)

    @everywhere
    def test_a_landmark_that_is_not_reached_in_time_is_given_up(self, num_envs):
        # From (1, 7) to (1, 1), 6 cells: landmarks at columns 5 and 3, then the goal at 1.
        rules = begin(num_envs, along(7, 1), *self.OPTIONS, landmark_distance=2, time_limit=2)
        seen = [(marked(rules), drive(rules, (ROW, 7))) for _ in range(6)]
        assert [columns for columns, _ in seen] == [[7, 5], [7, 5], [5, 3], [5, 3], [3, 1], [3, 1]]
        assert [step for step, (_, happened) in enumerate(seen, 1) if happened[0]] == [2, 4]
        assert seen[-1][1] == (False, False, True)

    @everywhere
    def test_the_next_landmark_comes_when_one_is_reached(self, num_envs):
        # From column 3 back: the second landmark, at 3, does not count before the first one, at 5.
        rules = begin(num_envs, along(7, 1), *self.OPTIONS, landmark_distance=2, time_limit=9)
        seen = [(drive(rules, (ROW, column)), marked(rules)) for column in (3, 5, 4, 3, 2, 1)]
        assert [columns for _, columns in seen] == [[7, 5], [5, 3], [5, 3], [3, 1], [3, 1], [3, 1]]
        assert [first for (first, _, _), _ in seen] == [False, True, False, True, False, False]
        assert seen[-1][0] == (False, True, False)
        assert (rules.info(0)["landmark"], rules.info(0)["steps_left"]) == (2, 9 - 2)

    def test_the_local_map_is_centred_on_the_legs_start(self):
        rules = begin(1, along(7, 1), *self.OPTIONS, landmark_distance=2)
        for column in (7, 5, 3):
            local_map = rules.context[0, 1]
            # The start stands at (4, 4): the corridor's ends, columns 1 and 7, are as far from there as from it.
            free = [index for index in range(9) if 1 <= column + index - 4 <= 7]
            np.testing.assert_array_equal(np.argwhere(local_map == 0), [[4, index] for index in free])
            drive(rules, (ROW, column - 2))

    def test_progress_is_that_to_the_goal_whatever_the_landmarks(self):
        rules = begin(1, along(7, 1), *self.OPTIONS, landmark_distance=2, time_limit=2, reward="progress")
        rewards = [drive(rules, (ROW, column)) and rules.reward(0) for column in (6, 7, 6, 5, 4)]
        assert rewards == [-1 + 1, -1 - 1, -1 + 1, -1 + 1, -1 + 1]

    @everywhere
    def test_a_goal_entered_before_the_landmarks_ends_the_episode(self, num_envs):
        episode = Episode(0, (1, 7), (7, 1), 0.0, 0)
        rules = begin(num_envs, episode, *self.OPTIONS, mazes=field(9), landmark_distance=5)
        assert rules.routes[0].cells == [(1, 7), (1, 2), (5, 1), (7, 1)]
        assert [drive(rules, (cell, 8 - cell)) for cell in (4, 7)] == [(False, False, False), (False, True, False)]


class TestInfosOfTheTask:
    @pytest.mark.parametrize("track", ["building", "rebuilt", "rough"])
    def test_a_track_tells_its_level_and_what_records_have(self, track):
        task = Task.of(track, level=(1, 2, 3))
        rng, rules, seen = np.random.default_rng(0), Rules(task, 1), set()
        for _ in range(12):
            episode = sample_episode(task, rng)
            rules.begin(0, episode)
            info, maze = rules.info(0), task.mazes[episode.maze]
            blocked = is_blocked(maze.walls, show_map(task, episode).walls, (episode.start, episode.goal))
            level, distance = episode_level(task, episode), maze.distance(episode.start, episode.goal)
            expected = {"track": track, "level": level, "kind": maze.kind, "distance": distance, "blocked": blocked}
            expected |= {"way_left": distance, "time_limit": default_time_limit(distance, 1.0, SLIDER, track=track)}
            assert {name: info[name] for name in expected} == expected
            seen.add((level, blocked))
        assert len({level for level, _ in seen}) == 3
        assert {blocked for _, blocked in seen} == ({False} if track == "building" else {False, True})

    def test_the_way_in_a_large_maze_is_measured_if_progress_is_rewarded_only(self):
        episode, mazes = Episode(0, (1, 1), (40, 45), 0.0, 0), field(50)
        for rewarded, way in (("sparse", -1), ("progress", 39 + 44)):
            info = begin(1, episode, mazes=mazes, reward=rewarded).info(0)
            assert (info["way_left"], info["distance"]) == (way, way)


class TestObservation:
    def test_noise_changes_the_observed_position_only(self):
        rules = begin(2, along(1, 4), position_noise=0.5)
        true = np.tile(np.arange(12.0), (2, 1))
        observed = np.array([rules.observe(true.copy(), np.arange(2))["state"] for _ in range(300)])
        noise = observed - true
        np.testing.assert_array_equal(noise[:, :, 2:], 0)
        np.testing.assert_array_equal(noise[:, 0], noise[:, 1])  # of one episode
        assert noise[:, 0, :2].std() == pytest.approx(0.5, rel=0.1)
        assert abs(noise[:, 0, :2].mean()) < 0.1
        assert drive(rules, (ROW, 4)) == (False, True, False)  # the true position decides
