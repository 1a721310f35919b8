"""Makes the benchmark `paper`: `python -m benchmarks.freeze DIR` writes its files byte for byte as they ship."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import pathlib
import sys
from collections.abc import Mapping
from typing import Any

import numpy as np

from mazebench.constants import TASK_VERSION
from mazebench.evaluation.measured_oracle import measure_oracle_steps
from mazebench.maps.benchmark import MANIFEST, MAZES_PER_SPLIT, PAPER_BENCHMARK, SIZES, SPLITS, mazes_file
from mazebench.maps.kinds.dfs import DFS_OPENINGS, dfs_walls
from mazebench.maps.maze import Maze, canonical_bytes
from mazebench.maps.text import format_maze
from mazebench.tasks.task import EVAL_DISTANCES, Task
from mazebench.tasks.trials import COLUMNS, Trial, benchmark_task_sizes, draw_trials, episodes_file

_MAZE_SEED = 1  # with the size it seeds the stream that all its mazes are drawn from
_EPISODE_SEED = 0


def freeze(folder: pathlib.Path) -> None:
    """Writes mazes, eval episodes and their manifest into `folder`."""
    files = {}
    mazes = {size: draw_mazes(size) for size in SIZES}
    for size in SIZES:
        for index, split in enumerate(SPLITS):
            chosen = mazes[size][index * MAZES_PER_SPLIT : (index + 1) * MAZES_PER_SPLIT]
            files[mazes_file(size, split)] = "\n".join(map(format_maze, chosen))
    for task, size, _ in benchmark_task_sizes():
        distances = EVAL_DISTANCES if task == "local" else None
        spec = Task.of(task, mazes=mazes[size][MAZES_PER_SPLIT:], distances=distances)
        files[episodes_file(task, size)] = format_trials(spec, draw_trials(spec, seed=_EPISODE_SEED))
    generator = {"style": "dfs", "openings": DFS_OPENINGS, "seed": _MAZE_SEED, "episode_seed": _EPISODE_SEED}
    write_benchmark(folder, PAPER_BENCHMARK, generator, files)


def draw_mazes(size: int) -> list[Maze]:
    """Returns the train mazes, then the eval mazes of one size; no two are alike under rotations and mirror images."""
    rng = np.random.default_rng([_MAZE_SEED, size])
    unique: dict[bytes, np.ndarray] = {}
    while len(unique) < len(SPLITS) * MAZES_PER_SPLIT:
        walls = dfs_walls(size, rng)
        unique.setdefault(canonical_bytes(walls), walls)
    return [Maze(walls, f"{size}-{index}") for index, walls in enumerate(unique.values())]


def format_trials(task: Task, trials: list[Trial]) -> str:
    """Returns the text of a file of frozen episodes, with the steps that the oracle takes in each."""
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n").writerows([COLUMNS, *rows_of_trials(task, trials)])
    return text.getvalue()


def rows_of_trials(task: Task, trials: list[Trial]) -> list[list[Any]]:
    """Returns the values of `COLUMNS` for each episode, with the steps that the oracle takes in it."""
    rows = []
    for trial, steps in zip(trials, measure_oracle_steps(task, trials), strict=True):
        episode = trial.episode
        shortest = f"{trial.shortest_path:.9f}"  # nanometres: the same on every machine
        drawn = [episode.maze, *episode.start, *episode.goal, trial.distance, repr(episode.yaw), episode.seed]
        rows.append([*drawn, shortest, steps])
    return rows


def write_benchmark(
    folder: pathlib.Path, benchmark: str, generator: dict[str, Any], files: Mapping[str, str | bytes]
) -> None:
    """Writes texts and pictures by the names of their files, and their manifest."""
    contents = {name: text if isinstance(text, bytes) else text.encode("ascii") for name, text in files.items()}
    manifest = {
        "benchmark": benchmark,
        "version": TASK_VERSION,
        "generator": generator,
        "files": {name: hashlib.sha256(content).hexdigest() for name, content in sorted(contents.items())},
    }
    for name, content in (contents | {MANIFEST: (json.dumps(manifest, indent=1) + "\n").encode("ascii")}).items():
        folder.joinpath(name).parent.mkdir(parents=True, exist_ok=True)
        folder.joinpath(name).write_bytes(content)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m benchmarks.freeze DIR")
    freeze(pathlib.Path(sys.argv[1]))
