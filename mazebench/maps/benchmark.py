"""The frozen mazes of the benchmark: read from the package's assets and checked against their manifests.

There are five: `paper` is the paper's protocol. `tracks` has mazes of 31 x 31 cells of several kinds, in the splits
train, dev and eval. `tracks-goals` has later goals of the episodes of `tracks`, and `tracks-doors` episodes of the
track `doors` in its mazes. `real` has real buildings, which `mazebench.maps.real_buildings` reads.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
from importlib import resources
from typing import Any

from mazebench.constants import BENCHMARK_SIZES
from mazebench.errors import InputError, unknown
from mazebench.maps.maze import Maze
from mazebench.maps.text import parse_maze

PAPER_BENCHMARK, TRACKS_BENCHMARK, GOALS_BENCHMARK, REAL_BENCHMARK = "paper", "tracks", "tracks-goals", "real"
DOORS_BENCHMARK = "tracks-doors"
FOLDERS = {  # of the assets
    PAPER_BENCHMARK: "paper_mazes",
    TRACKS_BENCHMARK: "tracks",
    GOALS_BENCHMARK: "tracks_goals",
    REAL_BENCHMARK: "real",
    DOORS_BENCHMARK: "tracks_doors",
}
SIZES = BENCHMARK_SIZES
KINDS_SIZE = 31
SPLITS = ("train", "eval")
DEV = "dev"  # the tracks' split for choosing agents
ALL_SPLITS = ("train", DEV, "eval")
FROZEN_SPLITS = (DEV, "eval")  # those whose episodes are frozen
MAZES_PER_SPLIT = 20
MANIFEST = "manifest.json"


def mazes_file(group: int | str, split: str) -> str:
    """Returns the name of the file with the mazes of one split, and of one size or, of the tracks, of one kind."""
    return f"mazes-{group}-{split}.txt"


@functools.cache
def load_mazes(size: int, split: str) -> tuple[Maze, ...]:
    """Returns the 20 mazes of one size and split of the paper's protocol.

    Raises:
      InputError: if there is no such size or split.
    """
    if isinstance(size, str | float):
        raise InputError(f"expected size as a whole number, found {size!r}")
    if size not in SIZES:
        raise unknown("size", size, SIZES)
    if split not in SPLITS:
        raise unknown("split", split, SPLITS)
    return _read_mazes(PAPER_BENCHMARK, size, split, "dfs")


@functools.cache
def load_kind_mazes(split: str) -> tuple[Maze, ...]:
    """Returns the tracks' mazes of one split, kind by kind.

    Raises:
      InputError: if there is no such split.
    """
    if split not in ALL_SPLITS:
        raise unknown("split", split, ALL_SPLITS)
    kinds = manifest(TRACKS_BENCHMARK)["generator"]["kinds"][split]
    return tuple(maze for kind in kinds for maze in _read_mazes(TRACKS_BENCHMARK, kind, split, kind))


def _read_mazes(benchmark: str, group: int | str, split: str, kind: str) -> tuple[Maze, ...]:
    blocks = read_asset(mazes_file(group, split), benchmark).split("\n\n")
    mazes = (parse_maze(block, f"{group}-{split}-{index:02d}") for index, block in enumerate(blocks))
    return tuple(dataclasses.replace(maze, kind=kind) for maze in mazes)


def read_asset(name: str, benchmark: str = PAPER_BENCHMARK) -> str:
    """Returns the text of a file of a benchmark; see `read_asset_bytes`."""
    return read_asset_bytes(name, benchmark).decode("ascii")


def read_asset_bytes(name: str, benchmark: str) -> bytes:
    """Returns the content of a file of a benchmark.

    Raises:
      InputError: if its SHA-256 differs from the manifest's. A changed benchmark must be a new version.
    """
    content = _folder(benchmark).joinpath(name).read_bytes()
    expected, found = manifest(benchmark)["files"][name], hashlib.sha256(content).hexdigest()
    if found != expected:
        raise InputError(f"benchmark {benchmark}: {name} was changed: expected SHA-256 {expected}, found {found}")
    return content


@functools.cache
def manifest(benchmark: str = PAPER_BENCHMARK) -> dict[str, Any]:
    """Returns the manifest: a benchmark's name and version, how it was made, and the SHA-256 of each of its files."""
    return json.loads(_folder(benchmark).joinpath(MANIFEST).read_text(encoding="ascii"))


def manifest_hash(benchmark: str = PAPER_BENCHMARK) -> str:
    """Returns the SHA-256 of a manifest, which identifies the benchmark in results."""
    return hashlib.sha256(_folder(benchmark).joinpath(MANIFEST).read_bytes()).hexdigest()


def _folder(benchmark: str) -> resources.abc.Traversable:
    if benchmark not in FOLDERS:  # as a damaged result names it
        raise unknown("benchmark", benchmark, FOLDERS)
    return resources.files("mazebench_assets").joinpath(FOLDERS[benchmark])
