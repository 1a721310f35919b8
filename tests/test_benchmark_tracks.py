"""Benchmark v2: the mazes and episodes of the tracks are frozen, new, and made by one command."""

from __future__ import annotations

import collections

import pytest

from benchmarks.freeze_tracks import freeze_tracks, shown_hash
from mazebench.evaluation.options import EvalOptions
from mazebench.evaluation.plan import make_plan
from mazebench.maps.benchmark import (
    MANIFEST,
    SIZES,
    SPLITS,
    TRACK_SIZES,
    TRACKS_VERSION,
    load_mazes,
    load_track_mazes,
    manifest,
    read_asset,
)
from mazebench.maps.maze import canonical_bytes
from mazebench.maps.options import MazeOptions
from mazebench.tasks.build import load_task_mazes
from mazebench.tasks.options import TaskOptions
from mazebench.tasks.shown_map import show_map
from mazebench.tasks.tracks import TRACKS, tracks_of
from mazebench.tasks.tracks.base import LEVELS
from mazebench.tasks.trials import frozen_trials

PLAYED = [(name, level) for name in tracks_of(TRACKS_VERSION) for level in LEVELS]


def test_one_command_makes_the_files_byte_for_byte(tmp_path):
    freeze_tracks(tmp_path)
    made = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert set(made) == {*manifest(TRACKS_VERSION)["files"], MANIFEST}
    for name in manifest(TRACKS_VERSION)["files"]:
        assert made[name] == read_asset(name, TRACKS_VERSION).encode("ascii"), name


@pytest.mark.parametrize(("track", "level"), PLAYED)
def test_agents_are_shown_the_frozen_maps(track, level):
    size = TRACKS[track].sizes[level - 1]
    frozen = manifest(TRACKS_VERSION)["generator"]["contexts_sha256"][f"{track}-{level}"]
    trials = frozen_trials("local", size, TRACKS_VERSION)
    assert shown_hash(track, level, load_track_mazes(size, "eval"), trials) == frozen


def test_no_maze_is_like_another_one_or_like_one_of_v1():
    mazes = {(size, split): load_mazes(size, split) for size in SIZES for split in SPLITS}
    tracks = {(size, split, "v2"): load_track_mazes(size, split) for size in TRACK_SIZES for split in SPLITS}
    assert tracks.pop((13, "train", "v2")) == mazes[13, "train"]
    walls = [canonical_bytes(maze.walls) for some in (*mazes.values(), *tracks.values()) for maze in some]
    assert len(set(walls)) == len(walls)


def test_no_shown_map_is_like_a_maze_or_like_one_that_is_shown_of_another_maze():
    known = {canonical_bytes(maze.walls) for split in SPLITS for maze in load_mazes(13, split)}
    known |= {canonical_bytes(maze.walls) for maze in load_track_mazes(13, "eval")}
    shown = collections.defaultdict(set)
    for level in LEVELS:
        plan = make_plan(EvalOptions.of("random", track="stale", level=level))
        for trial in plan.trials:
            shown[canonical_bytes(show_map(plan.task, trial.episode).walls)].add(trial.episode.maze)
    assert not known & set(shown)
    assert all(len(mazes) == 1 for mazes in shown.values())


@pytest.mark.parametrize("size", TRACK_SIZES)
def test_each_maze_has_ten_episodes_and_distances_come_up_equally_often(size):
    trials = frozen_trials("local", size, TRACKS_VERSION)
    assert list(collections.Counter(trial.episode.maze for trial in trials).values()) == [10] * 20
    counts = collections.Counter(trial.distance for trial in trials)
    assert max(counts.values()) - min(counts.values()) <= 1
    track, level = next((TRACKS[name], level) for name, level in PLAYED if TRACKS[name].sizes[level - 1] == size)
    assert set(counts) == set(track.distances(level))


@pytest.mark.parametrize("track", tracks_of(TRACKS_VERSION))
def test_levels_in_mazes_of_one_size_have_the_same_episodes(track):
    by_size = collections.defaultdict(set)
    for level in LEVELS:
        plan = make_plan(EvalOptions.of("random", track=track, level=level))
        by_size[plan.task.size].add(plan.trials)
    assert all(len(trials) == 1 for trials in by_size.values())


def test_train_mazes_of_size_13_are_those_of_v1():
    assert load_task_mazes(TaskOptions(track="stale"), MazeOptions()) == load_mazes(13, "train")
