"""The config of the neural planner, with the reason for each number."""

from __future__ import annotations

import dataclasses
from typing import Annotated, Literal

from annotated_types import Interval

from mazebench.options import Options

from ..common.config_values import Ahead, Count, Factor, Length, Rows, Share, Size


@dataclasses.dataclass(frozen=True, kw_only=True)
class NeuralPlannerConfig(Options):
    """Sized for one core: a million steps in less than an hour."""

    # Who teaches: "reward", by PPO (Schulman et al. 2017), or "oracle", by imitation of the oracle's look-ahead in the
    # states that the agent itself drives into (DAgger: Ross et al. 2011).
    teacher: Literal["reward", "oracle"] = "reward"

    # Network
    channels: Size = 16  # of the convolutions that give cells their costs
    hidden: Size = 256  # units of the two layers of the policy
    ways: bool = True  # False, an ablation: all cells cost 1, so that the goal is seen as the crow flies
    plan_steps: Length = 4  # agent steps from one plan to the next
    # Of the policy in evaluations; at 0, some episodes end in standing still.
    temperature: Annotated[float, Interval(ge=0.0, le=10.0)] = 0.25

    # Experience
    num_envs: Count = 80  # side by side
    rollout_steps: Length = 50  # in each between two updates; the default milestones then end rollouts, too
    total_steps: Rows = 1_000_000  # of the environment; over the second half, the learning rate falls to 2 %

    # Learning
    kept_rollouts: Length = 25  # that imitation learns from: on few of them, the network learns their mazes by heart
    epochs: Length = 3  # an update has as many minibatches as so many passes over the newest rollout
    minibatches: Length = 8  # of a pass
    learning_rate: Factor = 7e-4  # Adam's
    max_gradient_norm: Factor = 0.5
    discount_steps: Ahead = 100.0  # steps ahead that count: a discount of 1 - 1 / 100
    trace_steps: Ahead = 20.0  # likewise of advantages: a lambda of 1 - 1 / 20
    reward_scale: Factor = 0.02  # a step counts -.02, so that values lie in [-2, 0]
    clip: Share = 0.2  # of the ratio of probabilities
    value_weight: Factor = 0.5  # of the loss of values
    entropy_weight: Factor = 0.01
    # m; an action that leaves so much more way is e times less wanted.
    label_temperature: Annotated[float, Interval(ge=0.001, le=10.0)] = 0.08
