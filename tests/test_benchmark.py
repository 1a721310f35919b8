"""The benchmark `paper` as shipped: what its manifest says, what its definition says, and made again byte for byte."""

from __future__ import annotations

import collections
import hashlib
import json
import pathlib
import shutil
from importlib import resources

import numpy as np
import pytest

import mazebench
from benchmarks import freeze
from mazebench.errors import InputError
from mazebench.maps import benchmark
from mazebench.maps.benchmark import MAZES_PER_SPLIT, SIZES, SPLITS, load_mazes, mazes_file, read_asset
from mazebench.maps.geodesic import DiscPaths
from mazebench.maps.maze import canonical_bytes, cell_to_point
from mazebench.tasks.task import Task
from mazebench.tasks.trials import benchmark_task_sizes, draw_trials, episodes_file, frozen_trials, select_trials

BODY_RADIUS = 0.15


@pytest.fixture(scope="module")
def shipped() -> pathlib.Path:
    with resources.as_file(resources.files("mazebench_assets").joinpath("paper_mazes")) as folder:
        yield folder


def test_files_when_compared_with_manifest(shipped):
    manifest = json.loads((shipped / "manifest.json").read_text())
    assert (manifest["benchmark"], manifest["version"]) == ("paper", 1)
    names = {path.name for path in shipped.iterdir()} - {"__init__.py", "__pycache__", "manifest.json"}
    assert set(manifest["files"]) == names
    expected = {mazes_file(size, split) for size in SIZES for split in SPLITS}
    expected |= {episodes_file(task, size) for task in ("local", "hierarchical") for size in SIZES}
    assert names == expected
    for name, sha256 in manifest["files"].items():
        assert hashlib.sha256((shipped / name).read_bytes()).hexdigest() == sha256


@pytest.mark.parametrize("size", SIZES)
def test_mazes_when_compared_up_to_symmetry(size):
    mazes = [maze for split in SPLITS for maze in load_mazes(size, split)]
    assert len(mazes) == len(SPLITS) * MAZES_PER_SPLIT == 40
    assert {maze.size for maze in mazes} == {size}
    assert len({canonical_bytes(maze.walls) for maze in mazes}) == 40
    assert [maze.name for maze in load_mazes(size, "eval")] == [f"{size}-eval-{index:02d}" for index in range(20)]


@pytest.mark.slow
def test_freeze_when_compared_with_shipped_files(shipped, tmp_path):
    freeze.freeze(tmp_path)
    made = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert set(made) == {path.name for path in shipped.iterdir()} - {"__init__.py", "__pycache__"}
    assert [name for name, content in made.items() if content != (shipped / name).read_bytes()] == []


def test_trials_when_drawn_again_in_part():
    # The first episodes of a (maze, distance) don't depend on how many are drawn, nor those of a maze on the others.
    mazes = load_mazes(13, "eval")
    drawn = draw_trials(Task.of(mazes=mazes[:3], distances=[4, 9]), episodes_per_distance=2)
    chosen = select_trials(Task.of(split="eval", distances=[9, 4]), episodes_per_distance=2)[: len(drawn)]
    assert [trial.episode for trial in drawn] == [trial.episode for trial in chosen]
    assert [trial.distance for trial in chosen] == [4, 4, 9, 9] * 3


@pytest.mark.parametrize("size", SIZES)
def test_local_trials_when_compared_with_their_mazes(size):
    mazes = load_mazes(size, "eval")
    trials = frozen_trials("local", size)
    assert len(trials) == 1500
    pairs = collections.defaultdict(set)
    for trial in trials:
        episode = trial.episode
        assert mazes[episode.maze].distance(episode.start, episode.goal) == trial.distance
        assert -np.pi <= episode.yaw < np.pi
        pairs[episode.maze, trial.distance].add((episode.start, episode.goal))
    assert set(pairs) == {(maze, distance) for maze in range(20) for distance in range(1, 16)}
    assert {len(different) for different in pairs.values()} == {5}
    order = [(trial.episode.maze, trial.distance) for trial in trials]
    assert order == sorted(order)
    yaws = np.array([trial.episode.yaw for trial in trials])
    assert abs(np.exp(1j * yaws).mean()) < 4 / np.sqrt(len(yaws))  # uniform: no direction is preferred
    assert len({trial.episode.seed for trial in trials}) == len(trials)


@pytest.mark.parametrize("size", SIZES)
def test_hierarchical_trials_when_compared_with_their_mazes(size):
    mazes = load_mazes(size, "eval")
    trials = frozen_trials("hierarchical", size)
    assert [trial.episode.maze for trial in trials] == list(range(20))
    for trial, maze in zip(trials, mazes, strict=True):
        # On the odd lattice the corners' cells are free.
        assert (trial.episode.start, trial.episode.goal) == ((1, size - 2), (size - 2, 1))
        assert maze.distance(trial.episode.start, trial.episode.goal) == trial.distance


@pytest.mark.parametrize(("task", "size", "count"), benchmark_task_sizes())
def test_shortest_paths_when_computed_again(task, size, count):
    trials = frozen_trials(task, size)
    assert len(trials) == count
    maze_of_paths, paths = -1, None
    for trial in trials if task == "hierarchical" else trials[::7]:
        episode = trial.episode
        maze = load_mazes(size, "eval")[episode.maze]
        if episode.maze != maze_of_paths:
            maze_of_paths, paths = episode.maze, DiscPaths(maze, BODY_RADIUS)
        expected = paths.length(cell_to_point(episode.start, size), episode.goal)
        assert trial.shortest_path == pytest.approx(expected, abs=1e-8)
        assert 0.5 - 1e-9 <= trial.shortest_path <= trial.distance - 0.5 + 1e-8


def test_the_croissant_description_has_the_hashes_of_the_files():
    assets = resources.files("mazebench_assets")
    described = json.loads(assets.joinpath("croissant.json").read_text())
    files = {file["@id"]: file["sha256"] for file in described["distribution"]}
    assert files == {name: hashlib.sha256(assets.joinpath(name).read_bytes()).hexdigest() for name in files}
    for name, folder in benchmark.FOLDERS.items():
        assert {f"{folder}/{file}" for file in (benchmark.MANIFEST, *benchmark.manifest(name)["files"])} <= set(files)
    assert f"version={{{mazebench.__version__}}}" in described["citeAs"]


class TestRefusal:
    @pytest.mark.parametrize("name", [mazes_file(13, "eval"), episodes_file("local", 13)])
    def test_asset_when_tampered_with(self, shipped, tmp_path, monkeypatch, name):
        copy = tmp_path / "paper_mazes"
        shutil.copytree(shipped, copy)
        monkeypatch.setattr(benchmark, "_folder", lambda version: copy)
        untouched = read_asset(name)
        (copy / name).write_text(untouched.replace("1", "2", 1).replace("#.", ".#", 1))
        with pytest.raises(InputError, match=rf"^benchmark paper: {name} was changed: expected SHA-256 \w+, found \w+"):
            read_asset(name)
        (copy / name).write_text(untouched)
        assert read_asset(name) == untouched
