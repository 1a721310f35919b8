"""Evaluates the oracle on all frozen episodes and writes its SPL: `python benchmarks/oracle_spl.py FILE`.

`assets/oracle/spl.json` was made this way.
"""

from __future__ import annotations

import json
import pathlib
import sys
import tempfile

import mazebench
from mazebench.evaluation.results import load_result
from mazebench.evaluation.trials import benchmark_task_sizes


def main(path: pathlib.Path) -> None:
    """Writes the SPL of each episode to `path`, in the order of the frozen episodes."""
    found = {}
    for task, size, _ in benchmark_task_sizes():
        with tempfile.TemporaryDirectory() as folder:
            summary = mazebench.evaluate("oracle", folder, task=task, size=size)
            found[f"{task}-{size}"] = [round(record.spl, 6) for record in load_result(pathlib.Path(folder)).records]
        print(f"{task} {size}: success rate {summary.overall.success_rate:.3f}, SPL {summary.overall.spl:.3f}")
    lines = ",\n".join(f'"{name}": {json.dumps(values)}' for name, values in found.items())
    path.write_text(f"{{\n{lines}\n}}\n", encoding="utf-8")


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
