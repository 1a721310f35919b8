"""Prints success rates on held-out mazes over the training runs of one agent or more, one checkpoint each.

Call it as `python benchmarks/over_seeds.py AGENT CHECKPOINT... [--agent AGENT CHECKPOINT...]...`. Intervals are over
runs and mazes together. Of several agents, it also prints the difference of each one and the next. The mazes are of no
split, and none of them is one on which training runs are watched. With `--trained-in NUM`, they are the train mazes of
runs with `--num-mazes NUM` instead, with 0 those of the benchmark.
"""

from __future__ import annotations

import argparse
import itertools
import pathlib
from collections.abc import Sequence

import numpy as np

from mazebench.agent import Agent, Interface
from mazebench.agent_loading import load_agent_class
from mazebench.evaluation.chunk import run_trials
from mazebench.maps.kinds import generate
from mazebench.results.intervals import Estimate, runs_interval
from mazebench.tasks.task import Task
from mazebench.tasks.trials import draw_trials

_DISTANCES = (2, 4, 6, 8, 10)
_EPISODES = 2  # per maze and distance


def main() -> None:
    """Prints a row for each checkpoint, then one for each agent, and for each agent and the next."""
    parser = argparse.ArgumentParser()
    parser.add_argument("first", nargs="+", metavar="AGENT CHECKPOINT...")
    parser.add_argument("--agent", nargs="+", action="append", default=[], metavar=("AGENT", "CHECKPOINT"))
    parser.add_argument("--seed", type=int, default=60_000)
    parser.add_argument("--mazes", type=int, default=100, help="with two episodes in each at each distance")
    parser.add_argument("--kind", default="dfs")
    parser.add_argument("--size", type=int, default=13, help="cells a side")
    parser.add_argument("--trained-in", type=int, metavar="NUM", help="train mazes instead")
    given = parser.parse_args()
    of_held_out = any(getattr(given, name) != parser.get_default(name) for name in ("seed", "mazes"))
    if of_held_out and given.trained_in is not None:
        parser.error("--seed and --mazes are of held-out mazes, so they can't be given with --trained-in")
    tasks = [_task(distance, given) for distance in _DISTANCES]
    interface = Interface("local", given.size, given.size)
    print("success rate at", " ".join(f"{distance} cells" for distance in _DISTANCES))

    scores, mazes = [], []
    for name, *checkpoints in (given.first, *given.agent):
        played = []
        for checkpoint in checkpoints:
            agent = load_agent_class(name).build(interface, checkpoint=pathlib.Path(checkpoint))
            results = [_outcomes(agent, task) for task in tasks]
            played.append([success for success, _ in results])
            mazes = [maze for _, maze in results]
            print(*(f"{success.mean():.3f}" for success in played[-1]), f" {name} {checkpoint}", flush=True)
        scores.append((name, np.array(played)))  # [R, distances, E]

    for name, values in scores:
        if len(values) > 1:
            _print_row([runs_interval(*at) for at in zip(values.swapaxes(0, 1), mazes, strict=True)], name)
    for (name, values), (other, others) in itertools.pairwise(scores):
        if min(len(values), len(others)) > 1:
            pairs = zip(values.swapaxes(0, 1), mazes, others.swapaxes(0, 1), strict=True)
            _print_row([runs_interval(*at) for at in pairs], f"{name} - {other}")


def _task(distance: int, given: argparse.Namespace) -> Task:
    """Returns the local task at one distance in the mazes that the options name."""
    if given.trained_in is None:
        streams, mazes = np.random.SeedSequence([given.seed, given.size]), []
        while len(mazes) < given.mazes:  # mazes in which no goal is as far away are left out
            rng = np.random.default_rng(streams.spawn(1)[0])
            maze = generate(given.kind, given.size, rng, f"held-out-{len(mazes)}")
            if maze.diameter >= distance:
                mazes.append(maze)
        return Task.of("local", mazes=mazes, distances=(distance,))
    drawn = {"kinds": (given.kind,), "num_mazes": given.trained_in} if given.trained_in else {}
    return Task.of("local", size=given.size, split="train", distances=(distance,), **drawn)


def _outcomes(agent: Agent, task: Task) -> tuple[np.ndarray, np.ndarray]:
    """Returns the success and the maze of each episode, in the order of the trials."""
    trials = dict(enumerate(draw_trials(task, _EPISODES)))
    ended = sorted(result for some in run_trials(agent, task, trials, len(trials)) for result in some)
    return (
        np.array([result.success for result in ended], dtype=float),
        np.array([trials[result.number].episode.maze for result in ended]),
    )


def _print_row(estimates: Sequence[Estimate], name: str) -> None:
    print(*(f"{each.value:.2f} [{each.low:.2f}, {each.high:.2f}]" for each in estimates), name, sep="  ")


if __name__ == "__main__":
    main()
