"""The robots of benchmarks/ceilings.py, which know part of the truth."""

from __future__ import annotations

import numpy as np

import mazebench
from benchmarks.ceilings import ToldNavigator, _drive, _is_on_time, _sample
from mazebench.tasks.shown_map import is_blocked, show_map
from mazebench.tasks.tracks import TRACKS
from mazebench.tasks.trials import select_trials


def square(*lines):
    return np.array([[cell == "#" for cell in line] for line in lines])


MAP = square("#####", "#...#", "#.#.#", "#...#", "#####")
START, GOAL = (1, 1), (1, 3)


class TestIdeal:
    def known(self):
        known = MAP.astype(np.int8)
        known[1, 2] = -1  # a door in the upper way
        return known

    def test_an_open_door_leads_straight_to_the_goal(self):
        assert _drive(MAP, self.known(), MAP, 0.0, 2.0, START, GOAL, 100) == (2.0, GOAL)

    def test_a_closed_door_costs_the_way_around(self):
        # The door is seen from the start, next to it.
        walls, known = MAP.copy(), self.known()
        walls[1, 2] = True
        assert _drive(walls, known, MAP, 0.0, 2.0, START, GOAL, 100) == (6.0, GOAL)
        assert known[1, 2] == 1

    def test_a_way_ends_after_the_moves_that_are_asked_for(self):
        assert _drive(MAP, self.known(), MAP, 0.0, 2.0, START, GOAL, 1) == (1.0, (1, 2))

    def test_no_way_is_infinite(self):
        walls, known = MAP.copy(), self.known()
        walls[1, 2] = walls[3, 2] = True
        known[3, 2] = -1
        assert _drive(walls, known, MAP, 0.0, 2.0, START, GOAL, 100)[0] == np.inf

    def test_samples_agree_with_what_is_known_and_with_the_number_of_moved_doors(self):
        known = MAP.astype(np.int8)
        known[1, 2] = known[2, 1] = known[2, 2] = -1  # two doors that the map has open, one closed
        for seed in range(5):
            sampled = _sample(known, MAP, 1, np.random.default_rng(seed))
            assert sampled[1, 2] + sampled[2, 1] == 1
            assert not sampled[2, 2]
            np.testing.assert_array_equal(sampled[known >= 0], MAP[known >= 0])

    def test_an_episode_whose_path_is_open_is_on_time(self):
        task = mazebench.Task.of("rebuilt", split="dev")
        [moved] = TRACKS["rebuilt"].levels[0].perturbations
        for trial in select_trials(task):
            episode = trial.episode
            shown = show_map(task, episode).walls
            if not is_blocked(task.mazes[episode.maze].walls, shown, (episode.start, episode.goal)):
                break
        assert _is_on_time(task, trial, moved, np.random.default_rng(0))


def test_the_told_navigator_knows_the_walls_once_one_stands_on_its_path():
    found = mazebench.evaluate(ToldNavigator, "rebuilt", level=2, split="dev", distances=[15], episodes_per_distance=8)
    assert found.privileged
    assert found.overall.success_rate == 1.0
