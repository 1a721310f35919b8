"""The config of DQN and MAH, with the reason for each number."""

from __future__ import annotations

import dataclasses
import math

from mazebench.errors import InputError

# The lowest and the highest value of each key that is bounded.
_RANGES = {
    "channels": (1, 1024),
    "hidden": (1, 8192),
    "num_envs": (1, 65536),
    "n_step": (1, 100),
    "replay_capacity": (2, 100_000_000),
    "min_rows": (1, 100_000_000),
    "groups": (1, 65536),
    "steps": (1, 65536),
    "steps_per_update": (1, 1_000_000),
    "learning_rate": (0.0, math.inf),
    "max_gradient_norm": (0.0, math.inf),
    "target_rate": (0.0, 1.0),
    "longest_value": (1.0, 1e6),
    "hindsight_ratio": (0.0, 1.0),
    "hindsight_mean_offset": (1.0, 1e6),
    "hindsight_window": (1, 1_000_000),
    "num_goals": (1, 1_000_000),
    "localization_weight": (0.0, math.inf),
    "priority_exponent": (0.0, 10.0),
    "importance_exponent": (0.0, 10.0),
    "epsilon_base": (0.0, 1.0),
    "epsilon_alpha": (0.0, 1000.0),
}


@dataclasses.dataclass(frozen=True)
class DQNConfig:
    """Ape-X DQN (Horgan et al. 2018) with hindsight (Andrychowicz et al. 2017), sized for two CPU cores.

    Raises:
      InputError: if a value is out of its range.
    """

    use_context: bool = True  # MAH with, DQN-dagger without: the paper's "no task context c provided"
    reading: bool = True  # of the map where the agent is; False, the paper's: one code of the whole context
    channels: int = 32  # of the map encoder
    hidden: int = 256  # units of the two layers after it
    num_envs: int = 128  # side by side, each with its own rate of random actions
    n_step: int = 3  # Ape-X's; hindsight recomputes rewards and ends within the n steps
    replay_capacity: int = 1_000_000  # rows of some 100 bytes
    min_rows: int = 20_000  # before learning begins
    groups: int = 32  # contexts in a batch
    steps: int = 16  # in each; they share the map's convolutions, which take most of an update
    steps_per_update: int = 256  # environment steps; fixed, so that scores do not depend on the speed of workers
    learning_rate: float = 5e-4  # Adam's; twice as much learns a small maze faster
    max_gradient_norm: float = 10.0  # against the steep slopes while values are still far off
    target_rate: float = 0.01  # of the target network's moving average
    longest_value: float = 100.0  # targets lie in [-this, 0]; bounds the values of goals out of reach by a timeout
    hindsight_ratio: float = 0.8  # HER's four relabelled samples for each original one
    hindsight_mean_offset: float = 16.0  # steps; about eight cells
    hindsight_window: int = 60  # steps; how far ahead a goal may lie, long enough for far ones
    relabel_start: bool = True  # beyond the paper, which keeps the start; gives contexts like those after a landmark
    num_goals: int = 4  # an episode, without a reset between: beyond the paper, whose episodes end at the goal
    symmetries: bool = True  # beyond the paper: rotations and mirror images as training data
    localization_weight: float = 0.1  # beyond the paper: of the loss on the estimated position on the map
    priority_exponent: float = 0.6  # Ape-X's
    importance_exponent: float = 0.4  # Ape-X's
    epsilon_base: float = 0.4  # Ape-X's ladder: environment i explores at base ** (1 + alpha i / (B - 1))
    epsilon_alpha: float = 7.0  # Ape-X's

    def __post_init__(self):
        for name, (lowest, highest) in _RANGES.items():
            value = getattr(self, name)
            if not lowest <= value <= highest:
                raise InputError(f"expected config key {name!r} from {lowest} to {highest}, found {value}")
        rows = self.replay_capacity // self.num_envs * self.num_envs
        if rows < self.min_rows:
            raise InputError(
                f"expected a replay_capacity of at least min_rows {self.min_rows}, found one of {rows} rows"
            )
