"""Prints what search adds at decision time: success rates on held-out mazes by kind and number of simulations.

Call it as `python benchmarks/simulations.py AGENT [CHECKPOINT...] [--searches KIND:N,...]`; `--help` lists the rest.
Rates are means over the checkpoints, with 95 % intervals over training runs and mazes together; over mazes alone, if
there is one checkpoint. The mazes are of no split; they are neither those on which training runs are watched nor those
of `wrong_maps.py`.
"""

from __future__ import annotations

import argparse
import dataclasses
import pathlib

import numpy as np
from wrong_maps import held_out_task, outcomes

from mazebench.agent import Interface
from mazebench.agent_loading import load_agent_class
from mazebench.results.intervals import runs_interval

_SIZE = 13
_SEARCHES = "gumbel:0,gumbel:4,gumbel:16,gumbel:64,puct:4,puct:16,puct:64"


def main() -> None:
    """Prints one row for each search, over all checkpoints."""
    parser = argparse.ArgumentParser()
    parser.add_argument("agent")
    parser.add_argument("checkpoints", nargs="*", type=pathlib.Path)
    parser.add_argument("--searches", default=_SEARCHES, help="KIND:SIMULATIONS, with commas between")
    parser.add_argument("--distances", default="4,6,8,10,12", help="cells, with commas between")
    parser.add_argument("--seed", type=int, default=50_000)
    parser.add_argument("--mazes", type=int, default=40)
    given = parser.parse_args()
    agent_class, distances = load_agent_class(given.agent), list(map(int, given.distances.split(",")))
    print("search: success rate at", ", ".join(map(str, distances)), "cells")
    for search in given.searches.split(","):
        kind, _, num_simulations = search.partition(":")
        cells = []
        for distance in distances:
            spec = held_out_task({"distances": (distance,)}, given.seed, given.mazes)
            success = []
            for checkpoint in given.checkpoints or [None]:
                agent = agent_class.build(Interface("local", _SIZE, _SIZE), checkpoint=checkpoint)
                agent.config = dataclasses.replace(agent.config, search=kind, num_eval_simulations=int(num_simulations))
                reached, _, maze = outcomes(agent, spec, False)
                success.append(reached)
            estimate = runs_interval(np.array(success), maze)
            cells.append(f"{estimate.value:.3f} [{estimate.low:.2f}, {estimate.high:.2f}]")
        print(f"{search}:", "  ".join(cells), flush=True)


if __name__ == "__main__":
    main()
