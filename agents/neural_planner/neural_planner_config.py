"""The config of the neural planner, with the reason for each number."""

from __future__ import annotations

import dataclasses
from typing import Annotated, Literal

from annotated_types import Interval

from ..common.config_values import Ahead, Count, Factor, Length, Share, Size
from ..imitation import ImitationConfig


@dataclasses.dataclass(frozen=True, kw_only=True)
class NeuralPlannerConfig(ImitationConfig):
    """Sized for one core: a million steps in less than an hour."""

    # Who teaches: "oracle", by imitation of its look-ahead in the states that the agent itself drives into (DAgger:
    # Ross et al. 2011), or "reward", by PPO (Schulman et al. 2017).
    teacher: Literal["reward", "oracle"] = "oracle"
    num_envs: Count = 40  # 80 make half as many updates of the same steps, too few in a run of some minutes
    learning_rate: Factor = 1e-3
    cost_rate: Factor = 3.0  # of the learning rate, for the costs of cells: at 1, walls stay cheap for long
    minibatches: Length = 16

    # Network
    channels: Size = 16  # of the convolutions that give cells their costs
    hidden: Size = 256  # units of the two layers of the policy
    ways: bool = True  # False, an ablation: all cells cost 1, so that the goal is seen as the crow flies
    plan_steps: Length = 4  # agent steps from one plan to the next
    # Of the policy in evaluations; at 0, some episodes end in standing still.
    temperature: Annotated[float, Interval(ge=0.0, le=10.0)] = 0.25

    # Learning from rewards
    discount_steps: Ahead = 100.0  # steps ahead that count: a discount of 1 - 1 / 100
    trace_steps: Ahead = 20.0  # likewise of advantages: a lambda of 1 - 1 / 20
    reward_scale: Factor = 0.02  # a step counts -.02, so that values lie in [-2, 0]
    clip: Share = 0.2  # of the ratio of probabilities
    value_weight: Factor = 0.5  # of the loss of values
    entropy_weight: Factor = 0.01
