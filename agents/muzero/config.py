"""The config that the agents with a learned model share, with the reason for each number."""

from __future__ import annotations

import dataclasses
import math
from typing import ClassVar

from mazebench.errors import InputError


@dataclasses.dataclass(frozen=True)
class MuZeroConfig:
    """MuZero with hindsight, sized for two CPU cores.

    Raises:
      InputError: if a value is out of its range.
    """

    # The lowest and the highest value of each key that is bounded, and the values of each key that has a few.
    RANGES: ClassVar[dict[str, tuple[float, float]]] = {
        "latent": (1, 1024),
        "hidden": (1, 4096),
        "head_hidden": (1, 8192),
        "longest_value": (1, 1000),
        "num_envs": (1, 65536),
        "temperature": (1e-3, math.inf),
        "replay_capacity": (2, 100_000_000),
        "min_rows": (1, 100_000_000),
        "groups": (1, 65536),
        "sequences": (1, 65536),
        "sequence_steps": (1, 1000),
        "unroll": (1, 1000),
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
    }
    CHOICES: ClassVar[dict[str, tuple[str, ...]]] = {}

    # Networks
    latent: int = 32  # numbers of a latent state that are learned
    hidden: int = 128  # units of encoder and transition
    head_hidden: int = 256  # units of the two layers of policy and value
    longest_value: int = 100  # values lie in [-this, 0]; bounds the values of goals out of reach by a timeout
    # Exploration
    epsilon_base: float = 0.4  # Ape-X's ladder, beside the noise in the choice of actions: environment i takes a
    epsilon_alpha: float = 7.0  # random action at base ** (1 + alpha i / (B - 1))
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
    temperature: float = 0.4  # steps; of the policy that lookahead improves, softmax(q / temperature)
    steps_per_update: int = 256  # environment steps; fixed, so that scores do not depend on the speed of workers
    learning_rate: float = 3e-3  # AdamW's
    constant_updates: int = 2500  # before the learning rate falls, as one over the number of updates
    weight_decay: float = 1e-4  # AdamW's
    max_gradient_norm: float = 10.0  # against the steep slopes while values are still far off
    target_rate: float = 0.01  # of the target network's moving average
    model_weight: float = 1.0  # of the paper's auxiliary loss; 1 in the paper

    def __post_init__(self):
        for name, value in dataclasses.asdict(self).items():
            if name in self.RANGES and not self.RANGES[name][0] <= value <= self.RANGES[name][1]:
                low, high = self.RANGES[name]
                raise InputError(f"expected config key {name!r} from {low} to {high}, found {value}")
            if name in self.CHOICES and value not in self.CHOICES[name]:
                raise InputError(
                    f"expected config key {name!r} as one of {', '.join(self.CHOICES[name])}, found {value!r}"
                )
        if self.sequence_steps < self.unroll:
            raise InputError(f"expected sequence_steps of at least unroll {self.unroll}, found {self.sequence_steps}")
        rows = self.replay_capacity // self.num_envs * self.num_envs
        if rows < self.min_rows:
            raise InputError(
                f"expected a replay_capacity of at least min_rows {self.min_rows}, found one of {rows} rows"
            )
