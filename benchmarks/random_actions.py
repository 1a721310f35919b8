"""Prints what random actions add to an agent that acts greedily: success rates on held-out mazes by their share.

Call it as `python benchmarks/random_actions.py AGENT [CHECKPOINT]`.
"""

from __future__ import annotations

import pathlib
import sys

import numpy as np

from mazebench.agent import Interface
from mazebench.agent_loading import load_agent_class
from mazebench.tasks.build import make_spec
from mazebench.training.held_out import HeldOutEvaluation

_SIZE = 13
_NUM_MAZES = 40  # two episodes in each at each distance
_NUM_ACTIONS = 6
_SHARES = (0.0, 0.1, 0.3, 0.6, 1.0)


def main(name: str, checkpoint: pathlib.Path | None) -> None:
    """Prints one row for each share."""
    agent = load_agent_class(name).build(Interface("local", _SIZE, _SIZE), checkpoint=checkpoint)
    act, rng = agent.act, np.random.default_rng(0)

    def mixed(inputs, state):
        actions, state = act(inputs, state)
        at_random = rng.random(len(actions)) < share
        return np.where(at_random, rng.integers(_NUM_ACTIONS, size=len(actions)), actions), state

    agent.act = mixed
    evaluation = HeldOutEvaluation(make_spec("local", _SIZE), _NUM_MAZES, (1, 2, 4, 6))
    for share in _SHARES:
        rates = evaluation.success_rates(agent, lambda done, of: None)
        print(f"random actions {share:.1f}:", "  ".join(f"{d} cells {rate:.2f}" for d, rate in rates.items()))


if __name__ == "__main__":
    main(sys.argv[1], pathlib.Path(sys.argv[2]) if len(sys.argv) > 2 else None)
