"""Makes the benchmark `tracks`, mazes of several kinds and episodes in them, byte for byte as they ship.

`python -m benchmarks.freeze_kinds DIR --commit HASH` writes the splits train, dev and eval. The seed of eval is the
hash of the commit that holds all generators, tracks and agents, which nobody chooses; the manifest has it as
`eval_commit`. records/eval_log.md names a first draw that was not used.
"""

from __future__ import annotations

import hashlib
import itertools
import pathlib
from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np
import typer

from benchmarks.freeze import format_trials, write_benchmark
from mazebench.maps.benchmark import DEV, FROZEN_SPLITS, KINDS_SIZE, TRACKS_BENCHMARK, mazes_file
from mazebench.maps.kinds import KNOWN, NOVEL, generate
from mazebench.maps.maze import Maze, canonical_bytes
from mazebench.maps.text import format_maze
from mazebench.tasks.arena import arena_of
from mazebench.tasks.episode import sample_pair
from mazebench.tasks.shown_map import leg_context, show_map
from mazebench.tasks.task import Task, resolve
from mazebench.tasks.task_options import TaskOptions
from mazebench.tasks.tracks import DISTANCES, LEVELS, STANDING
from mazebench.tasks.trials import Trial, episodes_file, make_trial

KINDS = {"train": KNOWN, DEV: KNOWN, "eval": (*KNOWN, *NOVEL)}  # by split
MAZES_PER_SPLIT = 48
_SEED = 3  # each split adds one of its own
_EPISODES_PER_MAZE = 5


def freeze_kinds(
    folder: pathlib.Path,
    commit: Annotated[str, typer.Option(help="The hash of the commit from which the split eval is drawn.")],
) -> None:
    """Writes the splits train, dev and eval into `folder`; eval is drawn from the hash of a commit."""
    generator: dict[str, Any] = {"seed": _SEED, "kinds": {}, "contexts_sha256": {}, "eval_commit": commit}
    files: dict[str, str] = {}
    known: set[bytes] = set()
    for split, seed in (("train", 0), (DEV, 1), ("eval", int(commit, 16))):
        rng = np.random.default_rng([_SEED, seed])
        mazes = [maze for kind in KINDS[split] for maze in draw_mazes(kind, split, known, rng)]
        generator["kinds"][split] = KINDS[split]
        for kind in KINDS[split]:
            files[mazes_file(kind, split)] = "\n".join(format_maze(maze) for maze in mazes if maze.kind == kind)
        if split in FROZEN_SPLITS:
            trials = draw_kind_trials(mazes, rng)
            files[episodes_file("local", KINDS_SIZE, split)] = format_trials(_task("building", 1, mazes), trials)
            generator["contexts_sha256"][split] = {
                f"{track}-{level}": contexts_hash(track, level, mazes, trials)
                for track, level in itertools.product(STANDING, LEVELS)
            }
    write_benchmark(folder, TRACKS_BENCHMARK, generator, files)


def draw_mazes(kind: str, split: str, known: set[bytes], rng: np.random.Generator) -> list[Maze]:
    """Returns the mazes of a kind in a split.

    None is like one of `known`, to which they are added, under rotations and mirror images. In each of them, goals can
    be as far away as the tracks want.
    """
    mazes: list[Maze] = []
    while len(mazes) < MAZES_PER_SPLIT // len(KINDS[split]):
        maze = generate(kind, KINDS_SIZE, rng, f"{kind}-{len(mazes)}")
        if maze.diameter >= max(DISTANCES) and canonical_bytes(maze.walls) not in known:
            known.add(canonical_bytes(maze.walls))
            mazes.append(maze)
    return mazes


def draw_kind_trials(mazes: Sequence[Maze], rng: np.random.Generator) -> list[Trial]:
    """Returns five episodes in each maze, by maze; every distance comes up about as often as every other one."""
    # All distances in a random order, then all of them in another one, and so on.
    distances = itertools.chain.from_iterable(rng.permutation(DISTANCES).tolist() for _ in itertools.count())
    return [
        make_trial(maze, index, sample_pair(maze, distance, rng), rng)
        for index, maze in enumerate(mazes)
        for distance in sorted(itertools.islice(distances, _EPISODES_PER_MAZE))
    ]


def contexts_hash(track: str, level: int, mazes: Sequence[Maze], trials: Sequence[Trial]) -> str:
    """Returns the SHA-256 of the contexts of the episodes of a track and level, with 8 bits a value."""
    spec = _task(track, level, mazes)
    digest = hashlib.sha256()
    for trial in trials:
        episode = trial.episode
        context = leg_context(spec, show_map(spec, episode), episode.start, episode.goal)
        digest.update(np.rint(255 * context).astype(np.uint8).tobytes())
    return digest.hexdigest()


def _task(track: str, level: int, mazes: Sequence[Maze]) -> Task:
    asked = TaskOptions(task=track, level=(level,), distances=DISTANCES)
    return resolve(asked, arena=arena_of(asked, tuple(mazes)))


if __name__ == "__main__":
    typer.run(freeze_kinds)
