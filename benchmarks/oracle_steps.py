"""Plays the oracle in the frozen episodes of v1 and v2 and writes its steps: `python benchmarks/oracle_steps.py FILE`.

`assets/oracle/steps.json` was made this way; `mazebench/results/oracle.py` has its SHA-256. Tracks in mazes of one size
have the same episodes in the same worlds, so one track stands for all of them.
"""

from __future__ import annotations

import hashlib
import json
import pathlib
import sys

from mazebench.evaluation.oracle import measure_oracle_steps
from mazebench.maps.benchmark import TRACKS_VERSION, VERSION
from mazebench.results.oracle import oracle_key
from mazebench.tasks.build import make_spec
from mazebench.tasks.trials import benchmark_task_sizes, frozen_trials

_TRACKS = (("stale", 1), ("far", 1), ("far", 2))


def main(path: pathlib.Path) -> None:
    """Writes the steps in each episode to `path`, in the order of the frozen episodes, and prints the file's hash."""
    tasks = [(VERSION, make_spec(task, size, "eval")) for task, size, _ in benchmark_task_sizes()]
    tasks += [(TRACKS_VERSION, make_spec(track, level=level, split="eval")) for track, level in _TRACKS]
    lines = []
    for version, task in tasks:
        steps = measure_oracle_steps(task, frozen_trials(task.task, task.size, version))
        key = oracle_key(version, task.task, task.size)
        reached = [each for each in steps if each is not None]
        print(f"{key}: {len(reached)} of {len(steps)} goals, {sum(reached) / len(reached):.2f} steps on average")
        lines.append(f'"{key}": {json.dumps(steps, separators=(",", ":"))}')
    path.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="ascii")
    print("SHA-256", hashlib.sha256(path.read_bytes()).hexdigest())


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
