"""Prints how much less than the rule belief-planner's networks err on unseen walls, in several kinds of mazes.

Call it as `python benchmarks/belief_losses.py CHECKPOINT... [--kind KIND]... [--trained-in NUM]`. A number is the
cross-entropy of the network over that of the rule, with a 95 % interval over batches of 16 scenes. It is 1 if the
network changes nothing. The scenes are of simulated walks with right and wrong maps, as in training. Each batch is of a
new maze; with `--trained-in NUM`, of one of the train mazes of runs with `--num-mazes NUM`.
"""

from __future__ import annotations

import argparse
import pathlib

import numpy as np
import torch
from mazebench_agents.belief_planner import BeliefPlanner
from mazebench_agents.belief_planner.config import BeliefPlannerConfig
from mazebench_agents.belief_planner.learner import draw_batch, losses
from mazebench_agents.belief_planner.network import BeliefNetwork

from mazebench.agent import Interface
from mazebench.maps.drawn import draw_mazes
from mazebench.maps.kinds import generate
from mazebench.maps.maze import Maze

_SIZE = 21  # cells a side, as in training
_KINDS = ("dfs", "house", "rooms", "cave", "obstacles", "warehouse")  # the first three are trained in
_CONFIG = BeliefPlannerConfig(task_share=1.0, batch_size=16)


def main() -> None:
    """Prints a row for each kind, with a number for each checkpoint."""
    parser = argparse.ArgumentParser()
    parser.add_argument("checkpoints", nargs="+", type=pathlib.Path, metavar="CHECKPOINT")
    parser.add_argument("--kind", action="append", help="three that it trains in and three others, if none is given")
    parser.add_argument("--trained-in", type=int, metavar="NUM", help="train mazes instead")
    parser.add_argument("--seed", type=int, default=61_000)
    parser.add_argument("--batches", type=int, default=100, help="of a kind")
    given = parser.parse_args()
    interface = Interface("local", _SIZE, _SIZE)
    networks = [BeliefPlanner.build(interface, checkpoint=each).network for each in given.checkpoints]
    for kind in given.kind or _KINDS:
        if given.trained_in:
            mazes = draw_mazes((kind,), _SIZE, "train", given.trained_in)
        else:
            rng = np.random.default_rng([given.seed, _SIZE])
            mazes = tuple(generate(kind, _SIZE, rng) for _ in range(given.batches))
        print(f"{kind:10}", *_ratios(networks, mazes, given), sep="  ", flush=True)


@torch.no_grad()
def _ratios(networks: list[BeliefNetwork], mazes: tuple[Maze, ...], given: argparse.Namespace) -> list[str]:
    """Returns the ratio of each network's loss of walls and the rule's, and its interval, as text."""
    means = np.zeros((given.batches, len(networks), 2))  # of a batch: the loss of a network, and of the rule
    for index in range(given.batches):
        maze = mazes[index % len(mazes)]
        batch = draw_batch((maze,), _CONFIG, np.random.default_rng([given.seed, index]))
        for column, network in enumerate(networks):
            found = losses(network, batch)
            means[index, column] = [float(found[name].mean()) for name in ("wall_loss", "rule_wall_loss")]
    own, rule = means.transpose(2, 1, 0)  # [networks, batches] each
    ratio = own.sum(axis=1) / rule.sum(axis=1)
    errors = own - ratio[:, None] * rule  # the variance of a ratio of means, linearized (the delta method)
    half_width = 1.96 * errors.std(axis=1, ddof=1) * np.sqrt(given.batches) / rule.sum(axis=1)
    return [f"{each:.3f} [{each - half:.3f}, {each + half:.3f}]" for each, half in zip(ratio, half_width, strict=True)]


if __name__ == "__main__":
    main()
