"""Several goals under one wrong map: where they are drawn, what a leg is, and a record of each."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest
from run_folders import Killed, kill_after, records_of, results_of, summary_of
from simple_mazes import field

from benchmarks.freeze_goals import freeze_goals
from mazebench.agent import SingleAgent
from mazebench.evaluation.evaluate import evaluate
from mazebench.evaluation.measured_oracle import measure_steps_of_legs
from mazebench.evaluation.suites import SUITES
from mazebench.maps.benchmark import GOALS_BENCHMARK, TRACKS_BENCHMARK, manifest, read_asset
from mazebench.maps.maze import Maze
from mazebench.results.comparison import compare_folders
from mazebench.results.reading import load_result
from mazebench.tasks.episode import goals_of, sample_episode
from mazebench.tasks.rules import Rules
from mazebench.tasks.shown_map import show_map
from mazebench.tasks.task import Task, resolve_for_evaluation
from mazebench.tasks.time_limit import default_time_limit
from mazebench.tasks.trials import frozen_trials, select_trials
from mazebench.world.bodies import SLIDER

NEAR = {"task": "building", "mazes": field(9), "distances": (3, 4), "episodes_per_distance": 4, "num_goals": 3}


class Waits(SingleAgent):
    """Stands still, so that it misses all goals."""

    def act(self, observation):
        return 4


class TestGoals:
    @pytest.mark.parametrize("track", ["building", "rebuilt"])
    def test_all_are_free_on_a_map_that_is_joined_at_the_distances_of_the_track(self, track):
        task, rng = Task.of(track, level=3, num_goals=5, split="dev"), np.random.default_rng(0)
        for _ in range(60):
            episode = sample_episode(task, rng)
            goals, shown = goals_of(task, episode), Maze(show_map(task, episode).walls, "raises if it is not joined")
            assert len(goals) == 5
            assert all(map(shown.is_free, (episode.start, *goals)))
            distances = map(task.mazes[episode.maze].distance, goals, goals[1:])
            assert set(distances) <= set(task.distances)

    def test_the_first_goals_do_not_depend_on_how_many_follow(self):
        two, five = (Task.of("rebuilt", num_goals=count) for count in (2, 5))
        episode = sample_episode(five, np.random.default_rng(1))
        assert goals_of(two, episode) == goals_of(five, episode)[:2]

    def test_a_leg_begins_where_the_body_is_with_the_time_limit_of_its_distance(self):
        task = Task.of("rebuilt", num_goals=3, split="dev")
        episode = select_trials(task)[0].episode
        maze, (first, second, third) = task.mazes[episode.maze], goals_of(task, episode)
        rules = Rules(task, 1)
        rules.begin(0, episode)

        def step(cell):
            rules.advance(np.array([[*maze.point(cell), 0.0]]), np.array([True]))
            return rules.info(0)

        def limit(start, goal):
            return default_time_limit(maze.distance(start, goal), 1.0, SLIDER, track="rebuilt")

        # The first goal is reached, the second one is missed: the time runs out in the first goal's cell.
        info = step(first)
        assert (info["goal_reached"], info["success"], info["is_first"], info["landmark"]) == (True, False, True, 1)
        assert info["steps_left"] == info["time_limit"] == limit(first, second)
        for _ in range(limit(first, second)):
            info = step(first)
        assert (info["goal_reached"], info["landmark"], info["distance"]) == (False, 2, maze.distance(first, third))
        assert info["steps_left"] == info["time_limit"] == limit(first, third)
        info = step(third)
        assert (info["goal_reached"], info["success"]) == (True, True)


class TestRecords:
    def test_each_leg_has_a_record_and_starts_in_the_goal_before(self, tmp_path):
        evaluate("oracle", out=tmp_path, record=True, **NEAR)
        records = records_of(tmp_path)
        assert [(each["episode"], each["leg"]) for each in records] == [(e, leg) for e in range(8) for leg in (1, 2, 3)]
        for before, after in itertools.pairwise(records):
            assert after["leg"] == 1 or after["start"] == before["goal"]
        assert all(each["success"] and each["oracle_steps"] == each["steps"] for each in records)
        assert not any(each["after_miss"] for each in records)
        summary = summary_of(tmp_path)
        assert (summary["episodes"], summary["overall"]["n"]) == (8, 24)
        assert [summary["by_fact"][f"goal {leg}"]["n"] for leg in (1, 2, 3)] == [8, 8, 8]
        with np.load(tmp_path / "trajectories.npz") as arrays:
            assert arrays["length"].tolist() == [each["steps"] + 1 for each in records]

    def test_a_leg_after_a_missed_goal_is_scored_from_where_the_body_is(self, tmp_path):
        evaluate(Waits, out=tmp_path / "waits", **NEAR)
        evaluate("oracle", out=tmp_path / "oracle", **NEAR)
        maze, records = field(9), records_of(tmp_path / "waits")
        for first, *later in (records[number : number + 3] for number in range(0, 24, 3)):
            assert [each["after_miss"] for each in (first, *later)] == [False, True, True]
            for each in later:
                assert each["start"] == first["start"]
                assert each["distance"] == maze.distance(tuple(each["start"]), tuple(each["goal"]))
                # It may stand in a goal already.
                assert each["success"] == (each["distance"] == 0)
                assert each["oracle_steps"] >= 1
        # Pairs are the legs that both began in the same cell.
        row = compare_folders(tmp_path / "oracle", tmp_path / "waits").parts[""].overall
        assert (row.num_episodes, row.metrics["success_rate"].difference.value) == (8, 1.0)

    def test_a_run_that_was_cut_off_within_an_episode_gives_the_same_bytes(self, tmp_path):
        whole, cut = tmp_path / "whole", tmp_path / "cut"
        evaluate("planner-closed-loop", out=whole, num_envs=3, **NEAR)
        with pytest.raises(Killed):
            evaluate("planner-closed-loop", out=cut, num_envs=3, progress=kill_after(4), **NEAR)
        journal = cut / "journal.jsonl"
        lines = journal.read_bytes().splitlines(keepends=True)
        assert len(lines) >= 12
        journal.write_bytes(b"".join(lines[:-1]) + lines[-1][:40])
        evaluate("planner-closed-loop", out=cut, resume=True, **NEAR)
        assert results_of(cut) == results_of(whole)
        assert len(load_result(cut).records) == 24


class TestSuites:
    @pytest.mark.slow
    def test_one_command_makes_the_files_byte_for_byte(self, tmp_path):
        freeze_goals(tmp_path)
        for name in manifest(GOALS_BENCHMARK)["files"]:
            assert (tmp_path / name).read_text() == read_asset(name, GOALS_BENCHMARK), name

    def test_first_legs_are_the_frozen_episodes_and_later_goals_are_drawn_as_they_are_frozen(self):
        for suite, split in (("tracks-goals", "eval"), ("tracks-goals-dev", "dev")):
            for part in SUITES[suite]:
                task = resolve_for_evaluation(part.task)
                trials, frozen = select_trials(task), frozen_trials("local", 31, TRACKS_BENCHMARK, split)
                assert [dataclasses.replace(trial, later_legs=()) for trial in trials] == list(frozen)
                for trial in trials:
                    maze = task.mazes[trial.episode.maze]
                    assert tuple(leg.goal for leg in trial.legs) == goals_of(task, trial.episode)
                    assert all(leg.distance == maze.distance(leg.start, leg.goal) for leg in trial.legs)
                    assert all(leg.oracle_steps for leg in trial.legs)

    def test_the_oracle_takes_the_frozen_steps_to_each_goal(self):
        task = resolve_for_evaluation(SUITES["tracks-goals-dev"][2].task)
        trials = select_trials(task)[::60]
        steps = measure_steps_of_legs(task, trials)
        assert steps == [[leg.oracle_steps for leg in trial.legs] for trial in trials]
