"""The frozen real buildings: what the files hold, how they are played, and what is refused."""

from __future__ import annotations

import collections
import csv
import itertools

import numpy as np
import pytest
from run_folders import summary_of

import mazebench
from mazebench.errors import InputError
from mazebench.evaluation.eval_options import RunOptions
from mazebench.evaluation.suites import SUITES, run_suite
from mazebench.maps.benchmark import FROZEN_SPLITS, REAL_BENCHMARK, manifest, read_asset, read_asset_bytes
from mazebench.maps.real_buildings import (
    ORIGINS,
    PREFIX,
    RIGHT,
    buildings,
    load_building,
    load_older,
)
from mazebench.report.episodes import join_episodes, read_results
from mazebench.results.reading import load_result
from mazebench.results.suite_groups import compare_maps, group_of, summarize_groups
from mazebench.tasks.trials import frozen_in_building, shortest_path
from mazebench.world.bodies import SLIDER

NUM_EPISODES = 12
NEAREST, FARTHEST = 15, 40  # m
BY_NAME = buildings()
NAMES = sorted(BY_NAME)
OLDER = [name for name in NAMES if BY_NAME[name].older]
DEV = [name for name in NAMES if BY_NAME[name].split == "dev"]
SMALL = min(
    (name for name in DEV if BY_NAME[name].setting == "changed-1"), key=lambda name: load_building(PREFIX + name).size
)


def sources() -> dict[str, dict[str, str]]:
    return {row["name"]: row for row in csv.DictReader(read_asset("sources.csv", REAL_BENCHMARK).splitlines())}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """The folder and the summaries of a suite with two buildings, and one of them changed."""
    older = BY_NAME[SMALL].older
    other = next(each for each in DEV if BY_NAME[each].setting == RIGHT and each != older)
    wanted = [older, SMALL, other]
    chosen = tuple(each for each in SUITES["real-dev"] if each.task.mazes.removeprefix(PREFIX) in wanted)
    SUITES["real-few"] = chosen
    folder = tmp_path_factory.mktemp("real") / "run"
    yield folder, run_suite("real-few", ["navigator"], folder)
    del SUITES["real-few"]


class TestFiles:
    def test_no_file_was_changed(self):
        for name in manifest(REAL_BENCHMARK)["files"]:
            assert read_asset_bytes(name, REAL_BENCHMARK)

    def test_buildings_of_a_site_are_in_one_split(self):
        splits = collections.defaultdict(set)
        for building in BY_NAME.values():
            splits[building.site].add(building.split)
            assert building.origin in ORIGINS
        assert all(len(own) == 1 for own in splits.values())
        counts = collections.Counter(building.split for building in BY_NAME.values() if building.setting == RIGHT)
        assert 0.25 < counts["dev"] / counts.total() < 0.42

    def test_no_maze_is_in_two_splits_or_its_own_older_map(self):
        splits = collections.defaultdict(set)
        for name in NAMES:
            splits[load_building(PREFIX + name)].add(BY_NAME[name].split)
        assert all(len(own) == 1 for own in splits.values())
        for name in OLDER:
            maze = load_building(PREFIX + name)
            assert not np.array_equal(maze.walls, load_older(PREFIX + BY_NAME[name].older, PREFIX + name).walls), name

    def test_each_map_has_its_source_with_the_licence_of_its_repository(self):
        known = sources()
        for building in BY_NAME.values():
            source = known[building.source]
            assert source["licence"] in ("Apache-2.0", "BSD", "MIT", "MIT-0")
            assert len(source["commit"]) >= 12
            assert len(source["image_sha256"]) == 64
            assert read_asset(f"licences/{source['licence_file']}", REAL_BENCHMARK)

    @pytest.mark.parametrize("name", NAMES)
    def test_episodes_have_ends_in_reach_of_each_other(self, name):
        maze, building = load_building(PREFIX + name), BY_NAME[name]
        trials = frozen_in_building(PREFIX + name)
        assert len(trials) == NUM_EPISODES
        joined = load_older(PREFIX + building.older, PREFIX + name).joined if building.older else ~maze.walls
        for trial in trials:
            start, goal = trial.episode.start, trial.episode.goal
            assert joined[start]
            assert joined[goal]
            assert maze.distance(start, goal) == trial.distance
            assert NEAREST - 0.5 <= trial.distance * maze.cell_size <= FARTHEST + 0.5
            assert trial.oracle_steps is not None
        first = trials[0]
        way = shortest_path(maze, first.episode.start, first.episode.goal, SLIDER)
        assert first.shortest_path == pytest.approx(way, abs=1e-8)


class TestTask:
    def test_a_building_is_played_by_its_name(self):
        env = mazebench.make("building", mazes=PREFIX + DEV[0])
        env.reset(seed=0)
        assert env.unwrapped.task.mazes == (load_building(PREFIX + DEV[0]),)
        assert env.unwrapped.task.options.split == "dev"

    def test_the_older_map_is_shown_in_the_changed_building(self):
        building = BY_NAME[SMALL]
        task = mazebench.Task.of("building", mazes=PREFIX + SMALL, shown=PREFIX + building.older)
        assert np.array_equal(task.arena.shown[0].walls, load_building(PREFIX + building.older).walls)
        assert task.options.benchmark == REAL_BENCHMARK
        again = mazebench.Task.from_json(task.options.to_json())
        assert again == task
        assert again.mazes == task.mazes

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({"mazes": "real:nowhere"}, "unknown real building 'nowhere'"),
            ({"mazes": PREFIX + DEV[0], "split": "eval"}, "expected split dev, found eval"),
            ({"mazes": PREFIX + DEV[0], "cell_size": 0.9}, "expected cell_size"),
            ({"mazes": PREFIX + DEV[0], "inflate": 0.1}, "expected no inflate"),
            ({"mazes": PREFIX + DEV[0], "shown": "plan.yaml"}, "expected mazes and shown of one kind"),
            ({"mazes": "plan.yaml", "shown": PREFIX + DEV[0]}, "expected mazes and shown of one kind"),
            ({"mazes": PREFIX + SMALL, "shown": f"{PREFIX}gdc-3"}, "expected real:"),
        ],
    )
    def test_what_does_not_fit_is_refused(self, options, message):
        with pytest.raises(InputError, match=message):
            mazebench.Task.of("building", **options)

    def test_other_tracks_play_it_as_a_maze_of_ones_own(self):
        summary = mazebench.evaluate("random", "local", mazes=PREFIX + SMALL, distances=[3], episodes_per_distance=1)
        assert summary.task.split_in_results == "custom"


class TestEvaluation:
    def test_the_frozen_episodes_are_played_with_frozen_oracle_steps(self, tmp_path):
        summary = mazebench.evaluate("random", "building", tmp_path, mazes=PREFIX + SMALL)
        assert (summary.benchmark, summary.task.split_in_results, summary.episodes) == (REAL_BENCHMARK, "dev", 12)
        trials = frozen_in_building(PREFIX + SMALL)
        records = load_result(tmp_path).records
        assert [record.oracle_steps for record in records] == [trial.oracle_steps for trial in trials]
        assert {record.model_extra["kind"] for record in records} == {BY_NAME[SMALL].origin}

    def test_fewer_episodes_are_the_first_ones(self):
        summary = mazebench.evaluate("random", "building", mazes=PREFIX + SMALL, episodes_per_maze=2)
        assert summary.episodes == 2


class TestSuites:
    @pytest.mark.parametrize("split", FROZEN_SPLITS)
    def test_each_building_is_played_with_each_of_its_maps(self, split):
        parts = SUITES["real" if split == "eval" else "real-dev"]
        assert len({part.name for part in parts}) == len(parts)
        played = collections.Counter(part.task.mazes for part in parts)
        assert played == {f"{PREFIX}{name}": 3 for name, building in BY_NAME.items() if building.split == split}
        groups = [key for key, _ in itertools.groupby(group_of(part.name) for part in parts)]
        assert len(set(groups)) == len(groups)

    def test_groups_are_summed_up_with_intervals_over_buildings(self, run):
        folder, summaries = run
        results = [load_result(folder / "navigator" / each.part) for each in summaries]
        groups = {str(summary.part): summary for summary in summarize_groups(results)}
        assert groups[RIGHT].episodes == 24
        own = [each.overall.success_rate for each in summaries if group_of(each.part) == RIGHT]
        assert groups[RIGHT].overall.success_rate == pytest.approx(sum(own) / 2)

    def test_maps_are_compared_in_the_same_episodes(self, run):
        folder, summaries = run
        results = [load_result(folder / "navigator" / each.part) for each in summaries]
        worth = compare_maps(results)
        assert worth["changed-1, map - no map"].num_episodes == 12
        of = {each.part.partition("--")[0]: each.overall.on_time["1.25"] for each in summaries if SMALL in each.part}
        row = worth["changed-1, right map - old map"].metrics["on_time_1.25"]
        assert row.difference.value == pytest.approx(of["changed-1-right-map"] - of["changed-1"])

    def test_a_run_that_was_cut_goes_on(self, run, tmp_path):
        folder, summaries = run
        last = summaries[-1].part
        before = (folder / "navigator" / last / "episodes.jsonl").read_bytes()
        summary_of(folder / "navigator" / last)
        (folder / "navigator" / last / "summary.json").unlink()
        run_suite("real-few", ["navigator"], folder, RunOptions(resume=True))
        assert (folder / "navigator" / last / "episodes.jsonl").read_bytes() == before

    def test_a_report_sets_buildings_of_a_setting_together(self, run):
        folder, _ = run
        episodes = join_episodes(read_results([folder]))
        sizes = episodes.groupby(["label", "setting"], observed=True).size()
        assert sizes.max() == 24
        assert len(set(episodes.setting)) == 4
