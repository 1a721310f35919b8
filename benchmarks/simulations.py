"""Prints what search adds at decision time: success rates on held-out mazes by kind and number of simulations.

Call it as `python benchmarks/simulations.py AGENT CHECKPOINT...`, with the checkpoints of one agent's runs.
"""

from __future__ import annotations

import dataclasses
import pathlib
import sys

import numpy as np

from mazebench.agent import Interface
from mazebench.agent_loading import load_agent_class
from mazebench.evaluation.intervals import wilson_interval
from mazebench.tasks.registry import make_spec
from mazebench.training.held_out import HeldOutEvaluation

_SIZE = 13
_NUM_MAZES = 40  # two episodes in each at each distance
_DISTANCES = (4, 6, 8, 10, 12)
_SEARCHES = (("none", 0), ("gumbel", 4), ("gumbel", 16), ("gumbel", 64), ("puct", 4), ("puct", 16), ("puct", 64))


def main(name: str, checkpoints: list[str]) -> None:
    """Prints one row for each search, over all checkpoints."""
    agent_class = load_agent_class(name)
    evaluation = HeldOutEvaluation(make_spec("local", _SIZE), _NUM_MAZES, _DISTANCES)
    num_episodes = 2 * _NUM_MAZES * len(checkpoints)
    print("search, simulations: success rate at", " ".join(f"{distance} cells" for distance in _DISTANCES))
    for search, num_simulations in _SEARCHES:
        rates = []
        for checkpoint in checkpoints:
            agent = agent_class.build(Interface("local", _SIZE, _SIZE), checkpoint=pathlib.Path(checkpoint))
            kind = "gumbel" if search == "none" else search
            agent.config = dataclasses.replace(agent.config, search=kind, num_eval_simulations=num_simulations)
            rates.append(list(evaluation.success_rates(agent, lambda done, of: None).values()))
        cells = []
        for rate in np.mean(rates, axis=0):
            low, high = wilson_interval(rate, num_episodes)
            cells.append(f"{rate:.2f} [{low:.2f}, {high:.2f}]")
        print(f"{search}, {num_simulations}:", "  ".join(cells), flush=True)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
