"""Makes the benchmark `tracks-goals`, later goals of the tracks' frozen episodes, byte for byte as they ship.

`python -m benchmarks.freeze_goals DIR` writes two goals for each episode of the splits dev and eval. They follow from
the episode's seed, and are the same on all tracks and levels. The oracle's steps are those of one drive to all goals:
it begins a leg where, and as fast as, it has come to the goal before.
"""

from __future__ import annotations

import csv
import io
import pathlib
import sys

from benchmarks.freeze import write_benchmark
from mazebench.evaluation.measured_oracle import measure_steps_of_legs
from mazebench.maps.benchmark import FROZEN_SPLITS, GOALS_BENCHMARK, KINDS_SIZE, TRACKS_BENCHMARK, manifest_hash
from mazebench.tasks.task import Task
from mazebench.tasks.trials import GOAL_COLUMNS, frozen_trials, goals_file, with_later_legs

_NUM_GOALS = 3


def freeze_goals(folder: pathlib.Path) -> None:
    """Writes the goals of the splits dev and eval, and their manifest, into `folder`."""
    files = {goals_file(split): format_goals(split) for split in FROZEN_SPLITS}
    # The episodes and mazes that the goals belong to.
    origin = {"num_goals": _NUM_GOALS, "tracks_manifest_sha256": manifest_hash(TRACKS_BENCHMARK)}
    write_benchmark(folder, GOALS_BENCHMARK, origin, files)


def format_goals(split: str) -> str:
    """Returns the text of a file of later goals, with the steps that the oracle takes to each."""
    task = Task.of("rebuilt", split=split, num_goals=_NUM_GOALS)
    trials = [with_later_legs(task, each) for each in frozen_trials("local", KINDS_SIZE, TRACKS_BENCHMARK, split)]
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(GOAL_COLUMNS)
    for number, (trial, steps) in enumerate(zip(trials, measure_steps_of_legs(task, trials), strict=True)):
        for index, leg in enumerate(trial.later_legs, 1):
            shortest = f"{leg.shortest_path:.9f}"  # nanometres: the same on every machine
            writer.writerow([number, index + 1, *leg.goal, leg.distance, shortest, steps[index]])
    return text.getvalue()


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m benchmarks.freeze_goals DIR")
    freeze_goals(pathlib.Path(sys.argv[1]))
