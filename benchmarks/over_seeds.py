"""Prints success rates on held-out mazes over the training runs of an agent, one checkpoint each.

Call it as `python benchmarks/over_seeds.py AGENT CHECKPOINT...`. The interval is Student's over the runs: it
speaks of another run of the same training on these mazes.
"""

from __future__ import annotations

import pathlib
import sys

import numpy as np
from scipy import stats

from mazebench.agent import Interface
from mazebench.agent_loading import load_agent_class
from mazebench.tasks.build import make_spec
from mazebench.training.held_out import HeldOutEvaluation

_SIZE = 13
_NUM_MAZES = 40  # two episodes in each at each distance
_DISTANCES = (2, 4, 6, 8, 10)


def main(name: str, checkpoints: list[str]) -> None:
    """Prints one row for each checkpoint, then their means."""
    agent_class = load_agent_class(name)
    evaluation = HeldOutEvaluation(make_spec("local", _SIZE), _NUM_MAZES, _DISTANCES)
    print("success rate at", " ".join(f"{distance} cells" for distance in _DISTANCES))
    rows = []
    for checkpoint in checkpoints:
        agent = agent_class.build(Interface("local", _SIZE, _SIZE), checkpoint=pathlib.Path(checkpoint))
        rows.append(list(evaluation.success_rates(agent, lambda done, of: None).values()))
        print(*(f"{rate:.3f}" for rate in rows[-1]), checkpoint, flush=True)
    rates = np.array(rows)
    if len(rates) > 1:
        half = stats.t.ppf(0.975, len(rates) - 1) * stats.sem(rates, axis=0)
        for mean, width in zip(rates.mean(axis=0), half, strict=True):
            print(f"{mean:.2f} [{max(mean - width, 0):.2f}, {min(mean + width, 1):.2f}]", end="  ")
        print("mean and 95 % interval")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
