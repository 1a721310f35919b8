"""The config of MMN, with the reason for each number."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Interval

from mazebench.options import OneOf, options

from ..common.ranges import Factor, Length, Size, Steps
from ..muzero.config import MuZeroConfig


@options
class MMNConfig(MuZeroConfig):
    """The config of MMN: the paper's choices where it states them, unless docs/agents/mmn.md says otherwise."""

    # Networks
    hypermodel: bool = True  # False, an ablation: the code of the context is an input of an ordinary transition
    rows: bool = True  # generates the first layer's weights of a position with convolutions, for each cell
    reading: bool = True  # the heads, the paper's g(s, c), read convolutions of the context at the estimated position
    embedding: Size = 64  # numbers of the code of a context, from which the other weights are generated
    task_code: Size = 64  # numbers of that code for the heads
    hidden: Size = 64  # units of the transition, all of whose weights are generated
    # Search
    search: Annotated[str, OneOf("gumbel", "puct")] = "gumbel"  # Gumbel MuZero; "puct": MuZero's, the paper's
    num_simulations: Annotated[int, Interval(ge=0, le=1000)] = 8  # in training
    num_eval_simulations: Annotated[int, Interval(ge=0, le=1000)] = 64  # in evaluation; search improves on the policy
    value_scale: Factor = 0.1  # Gumbel's c_scale: with maxvisit_init, values weigh one to two nats a step
    maxvisit_init: Factor = 10.0  # Gumbel's c_visit
    # Experience
    relabel_start: bool = False  # as in the paper
    keep_anchor: bool = True  # beyond the paper: after landmarks and relabelled starts, displacements are still
    # measured from the centre of the trajectory's first cell; the position within a later cell is unknown
    # Learning
    sequence_steps: Length = 10  # two unrolls
    unroll: Length = 5  # as many as n_step
    value_target: Annotated[str, OneOf("n_step", "tree_backup")] = "n_step"  # as in the paper; "tree_backup": over a
    # sequence, with the improved policy
    n_step: Length = 5  # of "n_step" values
    policy_target: Annotated[str, OneOf("search", "lookahead", "paper")] = "search"  # of the target network, under the
    # relabelled goal, without noise; "lookahead": one step of its model, instead; "paper": a search's where the goal
    # was real, else the network's own policy
    steps_per_update: Steps = 128  # an update costs more than one of belief-planner, so it is the time that is short
    hyper_rate: Factor = 0.1  # times the learning rate, for the weights of the layer that generates weights: a step
    # of Adam moves each generated weight by the L1 norm of the code
    scale_rate: Factor = 2.0  # times the learning rate, for the map's scale
