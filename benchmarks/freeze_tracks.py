"""Makes benchmark v2, the mazes and episodes of the tracks, byte for byte as they ship.

`python -m benchmarks.freeze_tracks DIR` writes its files.
"""

from __future__ import annotations

import hashlib
import itertools
import pathlib
import sys
from collections.abc import Iterator, Sequence

import numpy as np

from benchmarks.freeze import format_manifest, format_trials
from mazebench.maps.benchmark import (
    MANIFEST,
    MAZES_PER_SPLIT,
    SIZES,
    SPLITS,
    TRACK_SIZES,
    TRACKS_VERSION,
    load_mazes,
    mazes_file,
)
from mazebench.maps.kinds.dfs import DFS_OPENINGS, dfs_walls
from mazebench.maps.maze import Maze, canonical_bytes
from mazebench.maps.text import format_maze
from mazebench.tasks.build import make_spec
from mazebench.tasks.episode import sample_pair
from mazebench.tasks.shown_map import leg_context, show_map
from mazebench.tasks.tracks import TRACKS, tracks_of
from mazebench.tasks.tracks.base import LEVELS
from mazebench.tasks.trials import Trial, episodes_file, make_trial

_SEED = 2  # of version v2; with the size it seeds the streams that mazes and episodes are drawn from
_EPISODES_PER_MAZE = 10


def freeze_tracks(folder: pathlib.Path) -> None:
    """Writes mazes, eval episodes and their manifest into `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    files, eval_mazes, trials = {}, {}, {}
    for size in TRACK_SIZES:
        mazes = draw_track_mazes(size)
        for split, chosen in mazes.items():
            files[mazes_file(size, split)] = "\n".join(map(format_maze, chosen))
        eval_mazes[size], trials[size] = tuple(mazes["eval"]), draw_track_trials(mazes["eval"])
        files[episodes_file("local", size)] = format_trials(trials[size])
    shown = {
        f"{name}-{level}": shown_hash(name, level, eval_mazes[size], trials[size])
        for name in tracks_of(TRACKS_VERSION)
        for level, size in zip(LEVELS, TRACKS[name].sizes, strict=True)
    }
    generator = {"style": "dfs", "openings": DFS_OPENINGS, "seed": _SEED, "contexts_sha256": shown}
    files[MANIFEST] = format_manifest(TRACKS_VERSION, generator, files)
    for name, text in files.items():
        folder.joinpath(name).write_bytes(text.encode("ascii"))


def draw_track_mazes(size: int) -> dict[str, list[Maze]]:
    """Returns new mazes of a size by split; v1's train mazes are those of a size that v1 has.

    No two are alike under rotations and mirror images, and none is like one of v1. In each of them, goals can be as far
    away as the tracks want.
    """
    splits = ("eval",) if size in SIZES else SPLITS
    known: set[bytes] = set()
    if size in SIZES:
        known = {canonical_bytes(maze.walls) for split in SPLITS for maze in load_mazes(size, split)}
    farthest = max(_distances(size))
    rng = np.random.default_rng([_SEED, size])
    mazes: list[Maze] = []
    while len(mazes) < len(splits) * MAZES_PER_SPLIT:
        maze = Maze(dfs_walls(size, rng), f"{size}-{len(mazes)}")
        if maze.diameter >= farthest and canonical_bytes(maze.walls) not in known:
            known.add(canonical_bytes(maze.walls))
            mazes.append(maze)
    return {split: mazes[index * MAZES_PER_SPLIT :][:MAZES_PER_SPLIT] for index, split in enumerate(splits)}


def draw_track_trials(mazes: list[Maze]) -> list[Trial]:
    """Returns ten episodes in each maze, by maze; every distance comes up about as often as every other one."""
    size = mazes[0].size
    rng = np.random.default_rng([_SEED, size, _EPISODES_PER_MAZE])
    distances = _shuffled_rounds(_distances(size), rng)
    return [
        make_trial(maze, index, sample_pair(maze, distance, rng), rng)
        for index, maze in enumerate(mazes)
        for distance in sorted(itertools.islice(distances, _EPISODES_PER_MAZE))
    ]


def shown_hash(track: str, level: int, mazes: tuple[Maze, ...], trials: Sequence[Trial]) -> str:
    """Returns the SHA-256 of the contexts of the episodes of a track and level, with 8 bits a value."""
    spec = make_spec(track, maps=mazes, level=level, distances=TRACKS[track].distances(level))
    digest = hashlib.sha256()
    for trial in trials:
        episode = trial.episode
        context = leg_context(spec, show_map(spec, episode), episode.start, episode.goal)
        digest.update(np.rint(255 * context).astype(np.uint8).tobytes())
    return digest.hexdigest()


def _shuffled_rounds(values: tuple[int, ...], rng: np.random.Generator) -> Iterator[int]:
    """Yields all of `values` in a random order, then all of them in another one, and so on."""
    while True:
        yield from rng.permutation(values).tolist()


def _distances(size: int) -> tuple[int, ...]:
    """Returns the distances of the tracks that are played in mazes of `size` cells a side."""
    return next(
        TRACKS[name].distances(level)
        for name in tracks_of(TRACKS_VERSION)
        for level, track_size in enumerate(TRACKS[name].sizes, 1)
        if track_size == size
    )


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m benchmarks.freeze_tracks DIR")
    freeze_tracks(pathlib.Path(sys.argv[1]))
