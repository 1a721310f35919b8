"""Writes the oracle's steps in the frozen episodes of the paper's protocol: `python benchmarks/oracle_steps.py FILE`.

`assets/oracle/steps.json` was made this way; `mazebench/results/frozen_oracle.py` has its SHA-256.
"""

from __future__ import annotations

import hashlib
import json
import pathlib
import sys

from mazebench.evaluation.measured_oracle import measure_oracle_steps
from mazebench.results.frozen_oracle import oracle_key
from mazebench.tasks.task import Task
from mazebench.tasks.trials import benchmark_task_sizes, frozen_trials


def main(path: pathlib.Path) -> None:
    """Writes the steps in each episode to `path`, in the order of the frozen episodes, and prints the file's hash."""
    lines = []
    for name, size, _ in benchmark_task_sizes():
        steps = measure_oracle_steps(Task.of(name, size=size, split="eval"), frozen_trials(name, size))
        key = oracle_key(name, size)
        reached = [each for each in steps if each is not None]
        print(f"{key}: {len(reached)} of {len(steps)} goals, {sum(reached) / len(reached):.2f} steps on average")
        lines.append(f'"{key}": {json.dumps(steps, separators=(",", ":"))}')
    path.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="ascii")
    print("SHA-256", hashlib.sha256(path.read_bytes()).hexdigest())


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
