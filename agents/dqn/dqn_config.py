"""The config of DQN and MAH, with the reason for each number."""

from __future__ import annotations

import dataclasses
from typing import Annotated

from annotated_types import Interval

from mazebench.options import Options

from ..common.config_values import Ahead, Count, Exponent, Factor, Length, Rows, Share, Size, Steps, check_rows


@dataclasses.dataclass(frozen=True, kw_only=True)
class DQNConfig(Options):
    """Ape-X DQN (Horgan et al. 2018) with hindsight (Andrychowicz et al. 2017), sized for two CPU cores."""

    reading: bool = True  # MAH reads the map where it is; False, the paper's: one code of the whole context
    channels: Size = 32  # of the map encoder
    hidden: Size = 256  # units of the two layers after it
    num_envs: Count = 128  # side by side, each with its own rate of random actions
    n_step: Length = 3  # Ape-X's; hindsight recomputes rewards and ends within the n steps
    replay_capacity: Rows = 1_000_000  # rows of some 100 bytes
    min_rows: Rows = 20_000  # before learning begins
    groups: Count = 32  # contexts in a batch
    steps: Count = 16  # in each; they share the map's convolutions, which take most of an update
    steps_per_update: Steps = 256  # environment steps; fixed, so that scores do not depend on the speed of workers
    learning_rate: Factor = 5e-4  # Adam's; twice as much learns a small maze faster
    max_gradient_norm: Factor = 10.0  # against the steep slopes while values are still far off
    target_rate: Share = 0.01  # of the target network's moving average
    # Targets lie in [-this, 0], also those of goals that a timeout puts out of reach.
    longest_value: Ahead = 100.0  # steps
    hindsight_ratio: Share = 0.8  # HER's four relabelled samples for each original one
    hindsight_mean_offset: Ahead = 16.0  # steps; about eight cells
    hindsight_window: Steps = 60  # steps; how far ahead a goal may lie, long enough for far ones
    relabel_start: bool = True  # beyond the paper, which keeps the start; gives contexts like those after a landmark
    num_goals: Steps = 4  # per episode, without a reset between: beyond the paper, whose episodes end at the goal
    symmetries: bool = True  # beyond the paper: rotations and mirror images as training data
    localization_weight: Factor = 0.1  # beyond the paper: of the loss on the estimated position on the map
    priority_exponent: Exponent = 0.6  # Ape-X's
    importance_exponent: Exponent = 0.4  # Ape-X's
    epsilon_base: Share = 0.4  # Ape-X's ladder: environment i explores at base ** (1 + alpha i / (B - 1))
    epsilon_alpha: Annotated[float, Interval(ge=0.0, le=1000.0)] = 7.0  # Ape-X's

    def __post_init__(self):
        super().__post_init__()
        check_rows(self)
