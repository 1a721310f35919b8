"""Makes the benchmark `tracks-doors`, episodes of the track `doors` in the mazes of `tracks`, as they ship.

`python -m benchmarks.freeze_doors DIR --commit HASH` writes the splits dev and eval, a file for each level with the
same starts, goals and seeds. The seed of eval is the hash of the commit that holds the track, which nobody chooses. The
manifest has a hash of the times of all doors.
"""

from __future__ import annotations

import itertools
import pathlib
from typing import Annotated, Any

import numpy as np
import typer

from benchmarks.freeze import format_trials, write_benchmark
from mazebench.constants import FROZEN_PER_MAZE
from mazebench.maps.benchmark import DEV, DOORS_BENCHMARK, TRACKS_BENCHMARK, manifest_hash
from mazebench.tasks.episode import sample_pair_of, schedule_of
from mazebench.tasks.schedule import schedules_hash
from mazebench.tasks.streams import DOORS
from mazebench.tasks.task import Task
from mazebench.tasks.tracks import DISTANCES, LEVELS
from mazebench.tasks.trials import Trial, doors_file, make_trial

_SEED = 5  # each split adds one of its own


def freeze_doors(
    folder: pathlib.Path,
    commit: Annotated[str, typer.Option(help="The hash of the commit from which the split eval is drawn.")],
) -> None:
    """Writes the splits dev and eval, and their manifest, into `folder`; eval is drawn from the hash of a commit."""
    origin: dict[str, Any] = {"seed": _SEED, "eval_commit": commit, "schedules_sha256": {}}
    origin["tracks_manifest_sha256"] = manifest_hash(TRACKS_BENCHMARK)
    files: dict[str, str] = {}
    for split, seed in ((DEV, 1), ("eval", int(commit, 16))):
        tasks = [Task.of(DOORS, level=level, split=split) for level in LEVELS]
        trials = draw_door_trials(tasks[0], np.random.default_rng([_SEED, seed]))
        for level, task in zip(LEVELS, tasks, strict=True):
            files[doors_file(level, split)] = format_trials(task, trials)
            schedules = [schedule for trial in trials if (schedule := schedule_of(task, trial.episode))]
            origin["schedules_sha256"][f"{level}-{split}"] = schedules_hash(schedules)
    write_benchmark(folder, DOORS_BENCHMARK, origin, files)


def draw_door_trials(task: Task, rng: np.random.Generator) -> list[Trial]:
    """Returns five episodes in each maze, by maze; every distance comes up about as often as every other one."""
    distances = itertools.chain.from_iterable(rng.permutation(DISTANCES).tolist() for _ in itertools.count())
    return [
        make_trial(maze, index, sample_pair_of(task, index, distance, rng), rng)
        for index, maze in enumerate(task.mazes)
        for distance in sorted(itertools.islice(distances, FROZEN_PER_MAZE))
    ]


if __name__ == "__main__":
    typer.run(freeze_doors)
