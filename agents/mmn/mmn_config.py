"""The config of MMN, with the reason for each number."""

from __future__ import annotations

import dataclasses
from typing import Annotated, Literal

from annotated_types import Interval

from mazebench.agent import AgentConfig
from mazebench.errors import InputError
from mazebench.options import Options

from ..common.config_values import Ahead, Count, Factor, Length, Rows, Share, Size, Steps, Updates, check_rows

_Simulations = Annotated[int, Interval(ge=0, le=1000)]  # of a search


@dataclasses.dataclass(frozen=True, kw_only=True)
class MMNEvalConfig(AgentConfig):
    """The values that an evaluation may set."""

    num_eval_simulations: _Simulations | None = None  # None: as many as the config of the checkpoint says


@dataclasses.dataclass(frozen=True, kw_only=True)
class MMNConfig(Options):
    """The paper's choices where it states them, unless docs/agents/mmn.md says otherwise; sized for two CPU cores."""

    # Networks
    # An ablation without model: the heads give action values, learned by double Q-learning with values of n_step. What
    # concerns the model, search and policies is then without effect.
    model: bool = True
    hypermodel: bool = True  # False, an ablation: the code of the context is an input of an ordinary transition
    rows: bool = True  # generates the first layer's weights of a position with convolutions, for each cell
    reading: bool = True  # the heads, the paper's g(s, c), read convolutions of the context at the estimated position
    # How these convolutions see far: by dilations, 19 cells, or not at all: what they read of the cheapest ways to the
    # goal, over costs that they give to cells (beyond the paper). Contexts may then have any size.
    far: Literal["dilations", "paths"] = "dilations"
    embedding: Size = 64  # numbers of the code of a context, from which the other weights are generated
    task_code: Size = 64  # numbers of that code for the heads
    latent: Size = 32  # numbers of a latent state that are learned
    hidden: Size = 64  # units of encoder and transition; all weights of the transition are generated
    head_hidden: Size = 256  # units of the two layers of policy and value
    longest_value: Length = 100  # values lie in [-this, 0]; bounds the values of goals out of reach by a timeout

    # Search
    num_simulations: _Simulations = 8  # in training
    num_eval_simulations: _Simulations = 64  # in evaluation; search improves on the policy
    value_scale: Factor = 0.1  # Gumbel's c_scale: with maxvisit_init, values weigh one to two nats a step
    maxvisit_init: Factor = 10.0  # Gumbel's c_visit

    # Exploration: besides the noise in the choice of actions, environment i takes a random action at
    # base ** (1 + alpha i / (B - 1)).
    epsilon_base: Share = 0.4  # Ape-X's
    epsilon_alpha: Annotated[float, Interval(ge=0.0, le=1000.0)] = 7.0  # Ape-X's

    # Experience
    num_envs: Count = 128  # side by side
    num_goals: Steps = 4  # per episode, without a reset between: beyond the paper, whose episodes end at the goal
    replay_capacity: Rows = 1_000_000  # rows of some 100 bytes
    min_rows: Rows = 20_000  # before learning begins
    hindsight_ratio: Share = 0.8  # HER's four relabelled samples for each original one
    hindsight_mean_offset: Ahead = 24.0  # steps; about twelve cells of the path driven
    hindsight_window: Steps = 100  # steps; how far ahead a goal may lie, long enough for far ones
    relabel_start: bool = False  # as in the paper
    symmetries: bool = True  # beyond the paper: rotations and mirror images as training data

    # Learning
    groups: Count = 32  # contexts in a batch; the hypermodel runs once for each
    sequences: Count = 3  # sequences for each context
    sequence_steps: Length = 10  # of a sequence: unrolled from its first step and every `unroll` steps on, so twice
    unroll: Length = 5  # steps of the model, K; as many as n_step
    n_step: Length = 5  # of values, as in the paper
    # Environment steps; fixed, so that scores do not depend on the speed of workers. An update is costly: time is
    # short, not experience.
    steps_per_update: Steps = 128
    learning_rate: Factor = 3e-3  # AdamW's
    # Times the learning rate, for the weights of the layer that generates weights: a step of Adam moves each generated
    # weight by the L1 norm of the code.
    hyper_rate: Factor = 0.1
    scale_rate: Factor = 2.0  # times the learning rate, for the map's scale
    constant_updates: Updates = 2500  # before the learning rate falls, as one over the number of updates
    weight_decay: Factor = 1e-4  # AdamW's
    max_gradient_norm: Factor = 10.0  # against the steep slopes while values are still far off
    target_rate: Share = 0.01  # of the target network's moving average
    model_weight: Factor = 1.0  # of the paper's auxiliary loss; 1 in the paper

    def __post_init__(self):
        super().__post_init__()
        if not self.model and not self.reading:
            raise InputError("expected reading where there is no model, for the heads see the map by it; found neither")
        if self.sequence_steps < self.unroll:
            raise InputError(f"expected sequence_steps of at least unroll {self.unroll}, found {self.sequence_steps}")
        check_rows(self)

    @property
    def any_size(self) -> bool:
        """True if contexts may have another size than in training: nothing that is read depends on it."""
        return self.far == "paths"
