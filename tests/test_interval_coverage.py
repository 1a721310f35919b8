"""The simulation of docs/metrics.md: it runs, and prints tables under the heads that stand there."""

from __future__ import annotations

import pathlib
import runpy

ROOT = pathlib.Path(__file__).parents[1]


def test_simulation_prints_the_tables_of_the_docs(capsys):
    script = runpy.run_path(str(ROOT / "benchmarks" / "interval_coverage.py"))
    few = {"NUM_EVALUATIONS": 20, "NUM_RESAMPLES": 100}
    script["main"].__globals__.update(few)
    script["main"]()
    printed = capsys.readouterr().out.splitlines()
    shown = (ROOT / "docs" / "metrics.md").read_text().splitlines()
    heads = [line for line in printed if line.startswith("| mazes x episodes")]
    assert len(heads) == 6
    assert sum(line.startswith("| runs | mazes x episodes") for line in printed) == 2  # of means and of differences
    assert set(heads) <= set(shown)
