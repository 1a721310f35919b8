"""Prints what search adds at decision time: success rates on held-out mazes by kind and number of simulations.

Call it as `python benchmarks/simulations.py AGENT [CHECKPOINT...] [--searches KIND:N,...]`; `--help` lists the rest.
Rates are means over the checkpoints, and below each row are the differences to the first search, with 95 % intervals
over training runs and mazes together; over mazes alone, if there is one checkpoint. The mazes are of no split; they are
neither those on which training runs are watched nor those of `wrong_maps.py`.
"""

from __future__ import annotations

import argparse
import dataclasses
import pathlib
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from wrong_maps import held_out_task, outcomes, text_of

from mazebench.agent import Interface
from mazebench.agent_loading import load_agent_class
from mazebench.results.intervals import Estimate, runs_interval
from mazebench.tasks.spec import TaskSpec

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
    specs = [held_out_task({"distances": (distance,)}, given.seed, given.mazes) for distance in distances]
    first: list[np.ndarray] = []
    for search in given.searches.split(","):
        played = [_play(agent_class, given.checkpoints or [None], spec, search) for spec in specs]
        print(f"{search}:", _texts(runs_interval(*each) for each in played), flush=True)
        if first:
            pairs = zip(played, first, strict=True)
            print(f"{search} - the first:", _texts(runs_interval(*each, before) for each, before in pairs), flush=True)
        else:
            first = [success for success, _ in played]


def _play(
    agent_class: Any, checkpoints: Sequence[pathlib.Path | None], spec: TaskSpec, search: str
) -> tuple[np.ndarray, np.ndarray]:
    """Returns successes `[R, E]` of the checkpoints, and mazes `[E]`."""
    kind, _, num_simulations = search.partition(":")
    success = []
    for checkpoint in checkpoints:
        agent = agent_class.build(Interface("local", _SIZE, _SIZE), checkpoint=checkpoint)
        agent.config = dataclasses.replace(agent.config, search=kind, num_eval_simulations=int(num_simulations))
        reached, _, maze = outcomes(agent, spec, needs_truth=False)
        success.append(reached)
    return np.array(success), maze


def _texts(estimates: Iterable[Estimate]) -> str:
    return "  ".join(map(text_of, estimates))


if __name__ == "__main__":
    main()
