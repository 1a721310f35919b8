"""The config of MMN, with the reason for each number, and the presets."""

from __future__ import annotations

import dataclasses
import math

from mazebench.errors import InputError

# The lowest and the highest value of each key that is bounded.
_RANGES = {
    "channels": (1, 1024),
    "num_distances": (0, 64),
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
    "priority_exponent": (0.0, 10.0),
    "importance_exponent": (0.0, 10.0),
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
    "localization_weight": (0.0, math.inf),
    "distance_weight": (0.0, math.inf),
    "visit_weight": (0.0, math.inf),
    "epsilon_base": (0.0, 1.0),
    "epsilon_alpha": (0.0, 1000.0),
}
_CHOICES = {
    "hypermodel": ("spatial", "flat", "none"),
    "search": ("gumbel", "puct"),
    "policy_target": ("lookahead", "search", "paper"),
    "value_target": ("tree_backup", "n_step"),
}


@dataclasses.dataclass(frozen=True)
class MMNConfig:
    """MuZero with a hypermodel, sized for two CPU cores.

    Raises:
      InputError: if a value is out of its range.
    """

    # Networks
    hypermodel: str = "spatial"  # or "flat": all weights from one code of the context; "none": the code as an input
    channels: int = 32  # of the map encoder
    num_distances: int = 2  # maps of learned distances to the goal; beyond the paper; 0 for none
    latent: int = 32  # numbers of a latent state that are learned
    hidden: int = 128  # units of encoder and transition
    head_hidden: int = 256  # units of the two layers of policy and value
    longest_value: int = 100  # values lie in [-this, 0]; bounds the values of goals out of reach by a timeout
    predict_reward: bool = False  # as in the paper; by default the reward, -1 outside of the goal, is known
    # Search
    search: str = "gumbel"  # Gumbel MuZero; "puct": MuZero's, the paper's
    num_simulations: int = 8  # in training
    num_eval_simulations: int = 16  # in evaluation
    value_scale: float = 0.1  # Gumbel's c_scale: with maxvisit_init, values weigh one to two nats a step
    maxvisit_init: float = 10.0  # Gumbel's c_visit
    epsilon_base: float = 0.4  # Ape-X's ladder, beside the search's own noise: environment i takes a random action
    epsilon_alpha: float = 7.0  # at base ** (1 + alpha i / (B - 1))
    noise_ladder: bool = True  # multiplies Gumbel noise by 1 - i / (B - 1): the last environments act nearly as in
    # evaluation, so the replay holds the states in which evaluation gets stuck
    # Experience
    num_envs: int = 128  # side by side
    num_goals: int = 4  # an episode, without a reset between: beyond the paper, whose episodes end at the goal
    replay_capacity: int = 1_000_000  # rows of some 100 bytes
    min_rows: int = 20_000  # before learning begins
    priority_exponent: float = 0.0  # 0 draws uniformly
    importance_exponent: float = 0.4  # Ape-X's, where rows are drawn by priority
    hindsight_ratio: float = 0.8  # HER's four relabelled samples for each original one
    hindsight_mean_offset: float = 24.0  # steps; about twelve cells of the path driven
    hindsight_window: int = 100  # steps; how far ahead a goal may lie, long enough for far ones
    relabel_start: bool = True  # beyond the paper, which keeps the start; gives contexts like those after a landmark
    keep_anchor: bool = True  # beyond the paper: after landmarks and relabelled starts, displacements are still
    # measured from the centre of the trajectory's first cell; the position within a later cell is unknown
    symmetries: bool = True  # beyond the paper: rotations and mirror images as training data
    # Learning
    groups: int = 32  # contexts in a batch; the hypermodel runs once for each
    sequences: int = 3  # sequences for each context
    sequence_steps: int = 8  # of a sequence: unrolled from its first step and every `unroll` steps on
    unroll: int = 4  # steps of the model, K
    value_target: str = "tree_backup"  # over a sequence, with the improved policy; or the paper's "n_step"
    n_step: int = 5  # of "n_step" values
    policy_target: str = "lookahead"  # one step of the target network's model, relabelled; "search": all of a search;
    # "paper": a search's where the goal was the real one, the network's own policy where it was relabelled
    temperature: float = 0.4  # steps; of the improved policy, softmax(q / temperature), in "lookahead"
    steps_per_update: int = 256  # environment steps; fixed, so that scores do not depend on the speed of workers
    learning_rate: float = 3e-3  # AdamW's
    constant_updates: int = 3000  # before the learning rate falls, as one over the number of updates
    weight_decay: float = 1e-4  # AdamW's
    max_gradient_norm: float = 10.0  # against the steep slopes while values are still far off
    target_rate: float = 0.01  # of the target network's moving average
    model_weight: float = 1.0  # of the paper's auxiliary loss; 1 in the paper
    localization_weight: float = 0.1  # beyond the paper: of the loss on the estimated position on the map
    distance_weight: float = 0.02  # beyond the paper: of the loss on propagated distances, against values
    visit_weight: float = 0.3  # beyond the paper: of the loss on enterable cells, against those that were visited

    def __post_init__(self):
        for name, (lowest, highest) in _RANGES.items():
            value = getattr(self, name)
            if not lowest <= value <= highest:
                raise InputError(f"expected config key {name!r} from {lowest} to {highest}, found {value}")
        for name, choices in _CHOICES.items():
            if getattr(self, name) not in choices:
                raise InputError(
                    f"expected config key {name!r} as one of {', '.join(choices)}, found {getattr(self, name)!r}"
                )
        if self.sequence_steps < self.unroll:
            raise InputError(f"expected sequence_steps of at least unroll {self.unroll}, found {self.sequence_steps}")
        rows = self.replay_capacity // self.num_envs * self.num_envs
        if rows < self.min_rows:
            raise InputError(
                f"expected a replay_capacity of at least min_rows {self.min_rows}, found one of {rows} rows"
            )


PRESETS = {
    "default": MMNConfig(),
    # As far as these keys go, the choices of the paper; docs/agents/mmn.md lists what still differs.
    "paper": MMNConfig(
        hypermodel="flat",
        num_distances=0,
        predict_reward=True,
        search="puct",
        epsilon_base=0.0,
        num_goals=1,
        relabel_start=False,
        keep_anchor=False,
        symmetries=False,
        sequence_steps=10,
        unroll=5,
        value_target="n_step",
        policy_target="paper",
        localization_weight=0.0,
        distance_weight=0.0,
        visit_weight=0.0,
        learning_rate=1e-3,  # not in the paper; with the default's, the weights of the hypermodel "flat" diverge
    ),
}
