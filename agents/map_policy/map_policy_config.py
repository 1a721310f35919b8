"""The config of the map policy, with the reason for each number."""

from __future__ import annotations

import dataclasses
from typing import Literal

from ..common.config_values import Factor, Length, Rows, Size
from ..neural_planner.neural_planner_config import NeuralPlannerConfig


@dataclasses.dataclass(frozen=True, kw_only=True)
class MapPolicyConfig(NeuralPlannerConfig):
    """Sized for an hour of one core."""

    teacher: Literal["reward", "oracle"] = "oracle"
    read_steps: Length = 48  # of the convolutions over the map: goals are up to 40 cells away
    channels: Size = 16
    plan_steps: Length = 1000  # a map does not change in a leg
    total_steps: Rows = 1_000_000
    kept_rollouts: Length = 12  # pictures take 3 kB a step
    learning_rate: Factor = 1.5e-3
    max_gradient_norm: Factor = 1.0
