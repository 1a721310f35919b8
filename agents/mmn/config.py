"""The config of MMN, with the reason for each number."""

from __future__ import annotations

import dataclasses
import math
from typing import ClassVar

from ..muzero.config import MuZeroConfig


@dataclasses.dataclass(frozen=True)
class MMNConfig(MuZeroConfig):
    """The config of MMN: the paper's choices where it states them, unless docs/agents/mmn.md says otherwise."""

    RANGES: ClassVar[dict[str, tuple[float, float]]] = MuZeroConfig.RANGES | {
        "embedding": (1, 4096),
        "task_code": (1, 4096),
        "hyper_rate": (0.0, math.inf),
        "scale_rate": (0.0, math.inf),
        "num_simulations": (0, 1000),
        "num_eval_simulations": (0, 1000),
        "value_scale": (0.0, math.inf),
        "maxvisit_init": (0.0, math.inf),
        "n_step": (1, 1000),
    }
    CHOICES: ClassVar[dict[str, tuple[str, ...]]] = {
        "search": ("gumbel", "puct"),
        "policy_target": ("lookahead", "search", "paper"),
        "value_target": ("tree_backup", "n_step"),
    }

    # Networks
    hypermodel: bool = True  # False, an ablation: the code of the context is an input of an ordinary transition
    rows: bool = True  # generates the first layer's weights of a position with convolutions, for each cell
    reading: bool = True  # the heads, the paper's g(s, c), read convolutions of the context at the estimated position
    embedding: int = 64  # numbers of the code of a context, from which the other weights are generated
    task_code: int = 64  # numbers of that code for the heads
    hidden: int = 64  # units of the transition, all of whose weights are generated
    # Search
    search: str = "gumbel"  # Gumbel MuZero; "puct": MuZero's, the paper's
    num_simulations: int = 8  # in training
    num_eval_simulations: int = 64  # in evaluation; search improves on the policy
    value_scale: float = 0.1  # Gumbel's c_scale: with maxvisit_init, values weigh one to two nats a step
    maxvisit_init: float = 10.0  # Gumbel's c_visit
    # Experience
    relabel_start: bool = False  # as in the paper
    keep_anchor: bool = True  # beyond the paper: after landmarks and relabelled starts, displacements are still
    # measured from the centre of the trajectory's first cell; the position within a later cell is unknown
    # Learning
    sequence_steps: int = 10  # two unrolls
    unroll: int = 5  # as many as n_step
    value_target: str = "n_step"  # as in the paper; "tree_backup": over a sequence, with the improved policy
    n_step: int = 5  # of "n_step" values
    policy_target: str = "search"  # of the target network, under the relabelled goal, without noise; "lookahead": one
    # step of its model, instead; "paper": a search's where the goal was real, else the network's own policy
    steps_per_update: int = 128  # an update costs more than one of belief-planner, so it is the time that is short
    hyper_rate: float = 0.1  # times the learning rate, for the weights of the layer that generates weights: a step of
    # Adam moves each generated weight by the L1 norm of the code
    scale_rate: float = 2.0  # times the learning rate, for the map's scale
