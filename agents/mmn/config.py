"""The configs of MMN and MMN-paper, with the reason for each number."""

from __future__ import annotations

import dataclasses
import math

from mazebench.errors import InputError

# The lowest and the highest value of each key that is bounded.
_RANGES = {
    "latent": (1, 1024),
    "hidden": (1, 4096),
    "head_hidden": (1, 8192),
    "longest_value": (1, 1000),
    "num_envs": (1, 65536),
    "num_simulations": (0, 1000),
    "num_eval_simulations": (0, 1000),
    "value_scale": (0.0, math.inf),
    "maxvisit_init": (0.0, math.inf),
    "temperature": (1e-3, math.inf),
    "replay_capacity": (2, 100_000_000),
    "min_rows": (1, 100_000_000),
    "groups": (1, 65536),
    "sequences": (1, 65536),
    "sequence_steps": (1, 1000),
    "unroll": (1, 1000),
    "n_step": (1, 1000),
    "steps_per_update": (1, 1_000_000),
    "learning_rate": (0.0, math.inf),
    "constant_updates": (1, 1_000_000_000),
    "weight_decay": (0.0, math.inf),
    "max_gradient_norm": (0.0, math.inf),
    "target_rate": (0.0, 1.0),
    "hindsight_ratio": (0.0, 1.0),
    "hindsight_mean_offset": (1.0, 1e6),
    "hindsight_window": (1, 1_000_000),
    "num_goals": (1, 1_000_000),
    "model_weight": (0.0, math.inf),
    "epsilon_base": (0.0, 1.0),
    "epsilon_alpha": (0.0, 1000.0),
    # MMN's
    "channels": (1, 1024),
    "num_distances": (1, 64),
    "localization_weight": (0.0, math.inf),
    "distance_weight": (0.0, math.inf),
    "belief_channels": (1, 1024),
    "belief_weight": (0.0, math.inf),
    "belief_rate": (0.0, math.inf),
    "scale_updates": (1, 1_000_000_000),
    "wrong_maps": (0.0, 1.0),
    # MMN-paper's
    "embedding": (1, 4096),
    "task_code": (1, 4096),
    "hyper_rate": (0.0, math.inf),
    "scale_rate": (0.0, math.inf),
}
_CHOICES = {
    "search": ("gumbel", "puct"),
    "policy_target": ("lookahead", "search", "paper"),
    "value_target": ("tree_backup", "n_step"),
}


@dataclasses.dataclass(frozen=True)
class PlanningConfig:
    """What both agents have: MuZero with hindsight, sized for two CPU cores.

    Raises:
      InputError: if a value is out of its range.
    """

    # Networks
    latent: int = 32  # numbers of a latent state that are learned
    hidden: int = 128  # units of encoder and transition
    head_hidden: int = 256  # units of the two layers of policy and value
    longest_value: int = 100  # values lie in [-this, 0]; bounds the values of goals out of reach by a timeout
    # Search
    search: str = "gumbel"  # Gumbel MuZero; "puct": MuZero's, the paper's
    num_simulations: int = 8  # in training
    num_eval_simulations: int = 16  # in evaluation
    value_scale: float = 0.1  # Gumbel's c_scale: with maxvisit_init, values weigh one to two nats a step
    maxvisit_init: float = 10.0  # Gumbel's c_visit
    epsilon_base: float = 0.4  # Ape-X's ladder, beside the search's own noise: environment i takes a random action
    epsilon_alpha: float = 7.0  # at base ** (1 + alpha i / (B - 1))
    # Experience
    num_envs: int = 128  # side by side
    num_goals: int = 4  # an episode, without a reset between: beyond the paper, whose episodes end at the goal
    replay_capacity: int = 1_000_000  # rows of some 100 bytes
    min_rows: int = 20_000  # before learning begins
    hindsight_ratio: float = 0.8  # HER's four relabelled samples for each original one
    hindsight_mean_offset: float = 24.0  # steps; about twelve cells of the path driven
    hindsight_window: int = 100  # steps; how far ahead a goal may lie, long enough for far ones
    relabel_start: bool = True  # beyond the paper, which keeps the start; gives contexts like those after a landmark
    symmetries: bool = True  # beyond the paper: rotations and mirror images as training data
    # Learning
    groups: int = 32  # contexts in a batch; the hypermodel runs once for each
    sequences: int = 3  # sequences for each context
    sequence_steps: int = 8  # of a sequence: unrolled from its first step and every `unroll` steps on
    unroll: int = 4  # steps of the model, K
    value_target: str = "tree_backup"  # over a sequence, with the improved policy; or the paper's "n_step"
    n_step: int = 5  # of "n_step" values
    policy_target: str = (
        "lookahead"  # one step of the target network's model, relabelled; "search": all of a search, without noise;
    )
    # "paper": a search's where the goal was the real one, the network's own policy where it was relabelled
    temperature: float = 0.4  # steps; of the improved policy, softmax(q / temperature), in "lookahead"
    steps_per_update: int = 256  # environment steps; fixed, so that scores do not depend on the speed of workers
    learning_rate: float = 3e-3  # AdamW's
    constant_updates: int = 2500  # before the learning rate falls, as one over the number of updates
    weight_decay: float = 1e-4  # AdamW's
    max_gradient_norm: float = 10.0  # against the steep slopes while values are still far off
    target_rate: float = 0.01  # of the target network's moving average
    model_weight: float = 1.0  # of the paper's auxiliary loss; 1 in the paper

    def __post_init__(self):
        for name, value in dataclasses.asdict(self).items():
            if name in _RANGES and not _RANGES[name][0] <= value <= _RANGES[name][1]:
                raise InputError(
                    f"expected config key {name!r} from {_RANGES[name][0]} to {_RANGES[name][1]}, found {value}"
                )
            if name in _CHOICES and value not in _CHOICES[name]:
                raise InputError(f"expected config key {name!r} as one of {', '.join(_CHOICES[name])}, found {value!r}")
        if self.sequence_steps < self.unroll:
            raise InputError(f"expected sequence_steps of at least unroll {self.unroll}, found {self.sequence_steps}")
        rows = self.replay_capacity // self.num_envs * self.num_envs
        if rows < self.min_rows:
            raise InputError(
                f"expected a replay_capacity of at least min_rows {self.min_rows}, found one of {rows} rows"
            )


@dataclasses.dataclass(frozen=True)
class MMNConfig(PlanningConfig):
    """The config of MMN."""

    channels: int = 32  # of the map encoder
    num_distances: int = 2  # maps of learned distances to the goal; beyond the paper
    localization_weight: float = 0.1  # beyond the paper: of the loss on the estimated position on the map
    distance_weight: float = 0.02  # beyond the paper: of the loss on propagated distances, against values
    hindsight_mean_offset: float = 32.0  # steps; farther than in MMN-paper, since a wrong map makes ways longer
    hindsight_window: int = 150  # steps
    belief_channels: int = 32  # of the belief's convolutions
    belief_weight: float = 1.0  # beyond the paper: of the losses on where walls and the goal are
    scale_updates: int = 300  # before the learning rate of the map's scale falls: an error of it grows along the way
    belief_rate: float = 0.5  # times the learning rate, for the belief
    wrong_maps: float = 0.7  # beyond the paper: share of wrong maps among those that the belief learns from


@dataclasses.dataclass(frozen=True)
class PaperConfig(PlanningConfig):
    """The config of MMN-paper: the paper's choices where it states them."""

    hypermodel: bool = True  # False, an ablation: the code of the context is an input of an ordinary transition
    rows: bool = True  # generates the first layer's weights of a position with convolutions, for each cell
    reading: bool = True  # the heads, the paper's g(s, c), read convolutions of the context at the estimated position
    embedding: int = 64  # numbers of the code of a context, from which the other weights are generated
    task_code: int = 64  # numbers of that code for the heads
    hidden: int = 64  # units of the transition, all of whose weights are generated
    hyper_rate: float = 0.1  # times the learning rate, for the weights of the layer that generates weights: a step of
    # Adam moves each generated weight by the L1 norm of the code
    scale_rate: float = 2.0  # times the learning rate, for the map's scale
    num_eval_simulations: int = 64  # here, search improves on the policy
    relabel_start: bool = False  # as in the paper
    keep_anchor: bool = True  # beyond the paper: after landmarks and relabelled starts, displacements are still
    # measured from the centre of the trajectory's first cell; the position within a later cell is unknown
    sequence_steps: int = 10  # two unrolls
    unroll: int = 5  # as many as n_step
    value_target: str = "n_step"  # as in the paper
    policy_target: str = "search"  # of the target network, under the relabelled goal, without noise
    steps_per_update: int = 128  # an update costs more than in MMN, so it is the time that is short, not experience
