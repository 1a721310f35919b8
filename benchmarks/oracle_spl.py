"""Evaluates the oracle on all frozen episodes and writes its SPL: `python benchmarks/oracle_spl.py FILE`.

`assets/oracle/spl.json` was made this way. Tracks in mazes of one size have the same episodes in the same worlds, so
one track stands for all of them.
"""

from __future__ import annotations

import json
import pathlib
import sys
import tempfile
from typing import Any

import mazebench
from mazebench.maps.benchmark import TRACKS_VERSION, VERSION
from mazebench.results.oracle import oracle_key
from mazebench.results.reading import load_result
from mazebench.tasks.tracks import TRACKS
from mazebench.tasks.trials import benchmark_task_sizes


def main(path: pathlib.Path) -> None:
    """Writes the SPL of each episode to `path`, in the order of the frozen episodes."""
    found = {
        oracle_key(VERSION, task, size): measure_oracle(task=task, size=size)
        for task, size, _ in benchmark_task_sizes()
    }
    for track, level in (("stale", 1), ("far", 1), ("far", 2)):
        key = oracle_key(TRACKS_VERSION, "local", TRACKS[track].sizes[level - 1])
        found[key] = measure_oracle(track=track, level=level)
    lines = ",\n".join(f'"{name}": {json.dumps(values)}' for name, values in found.items())
    path.write_text(f"{{\n{lines}\n}}\n", encoding="utf-8")


def measure_oracle(**options: Any) -> list[float]:
    """Returns the oracle's SPL in each frozen episode that `options` name, in their order."""
    with tempfile.TemporaryDirectory() as folder:
        summary = mazebench.evaluate("oracle", folder, **options)
        print(f"{options}: success rate {summary.overall.success_rate:.3f}, SPL {summary.overall.spl:.3f}")
        return [round(record.spl, 6) for record in load_result(pathlib.Path(folder)).records]


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
