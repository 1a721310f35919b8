"""The frozen mazes of benchmark v1: read from the package's assets and checked against their manifest."""

from __future__ import annotations

import functools
import hashlib
import json
from importlib import resources
from typing import Any

from mazebench.errors import InputError, unknown
from mazebench.maps import BENCHMARK_SIZES
from mazebench.maps.maze import Maze
from mazebench.maps.text import parse_maze

VERSION = "v1"
SIZES = BENCHMARK_SIZES
SPLITS = ("train", "eval")
MAZES_PER_SPLIT = 20
MANIFEST = "manifest.json"


def mazes_file(size: int, split: str) -> str:
    """Returns the name of the file with the mazes of one size and split."""
    return f"mazes-{size}-{split}.txt"


def load_mazes(size: int, split: str) -> tuple[Maze, ...]:
    """Returns the 20 mazes of one size and split.

    Raises:
      InputError: if there is no such size or split.
    """
    if size not in SIZES:
        raise unknown("size", size, SIZES)
    if split not in SPLITS:
        raise unknown("split", split, SPLITS)
    return _load_mazes(size, split)


@functools.cache
def _load_mazes(size: int, split: str) -> tuple[Maze, ...]:
    blocks = read_asset(mazes_file(size, split)).split("\n\n")
    return tuple(parse_maze(block, f"{size}-{split}-{index:02d}") for index, block in enumerate(blocks))


def read_asset(name: str) -> str:
    """Returns the text of a file of the benchmark.

    Raises:
      InputError: if its SHA-256 differs from the manifest's. A changed benchmark must be a new version.
    """
    content = _folder().joinpath(name).read_bytes()
    expected, found = manifest()["files"][name], hashlib.sha256(content).hexdigest()
    if found != expected:
        raise InputError(f"benchmark {VERSION}: {name} was changed: expected SHA-256 {expected}, found {found}")
    return content.decode("ascii")


@functools.cache
def manifest() -> dict[str, Any]:
    """Returns the manifest: the benchmark's version, how it was made, and the SHA-256 of each of its files."""
    return json.loads(_folder().joinpath(MANIFEST).read_text(encoding="ascii"))


def manifest_hash() -> str:
    """Returns the SHA-256 of the manifest, which identifies the benchmark in results."""
    return hashlib.sha256(_folder().joinpath(MANIFEST).read_bytes()).hexdigest()


def _folder() -> resources.abc.Traversable:
    return resources.files("mazebench_assets").joinpath(VERSION)
