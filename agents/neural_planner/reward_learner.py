"""The learner of the neural planner from rewards: PPO (Schulman et al. 2017) on the last rollout.

`B` is the number of environments, `T` of steps of a rollout in each.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import torch
from torch.nn import functional

from mazebench.training.experience import Experience

from ..common.rollouts import RolloutLearner, Rows, Seen


class Choice(NamedTuple):
    """Actions chosen in B environments, with what a learner needs of the choice."""

    shared: list[np.ndarray]  # B of [4, L, L], the grids; the same object while a plan is kept
    parts: tuple[Any, ...]  # a `Situation` of B states
    log_probability: np.ndarray  # [B] float32, of the action, at temperature 1
    value: np.ndarray  # [B] float32


class RewardLearner(RolloutLearner):
    """Updates policy and values of its actor from the rewards of the last rollout."""

    actor: Any  # a `NeuralPlanner`, which imports this module

    def seen(self, experience: Experience) -> Seen:
        """Adds the action, its probability and value when it was chosen, and what followed."""
        choice = experience.notes
        chosen = experience.action, choice.log_probability, choice.value
        return Seen(choice.shared, (*choice.parts, *chosen, experience.reward, experience.terminated, experience.ended))

    def columns(self, parts: list[np.ndarray]) -> list[np.ndarray]:
        """Returns the situations, actions, their log probabilities and advantages, and what the value should be."""
        config = self._config
        *situation, action, log_probability, value, reward, terminated, ended = parts
        discount, trace = 1 - 1 / config.discount_steps, 1 - 1 / config.trace_steps
        advantage = advantages(config.reward_scale * reward, value, terminated, ended, discount, trace)
        targets = advantage.astype(np.float32), (advantage + value[:-1]).astype(np.float32)
        return [*(part[:-1] for part in (*situation, action, log_probability)), *targets]

    def losses(self, rows: Rows) -> dict[str, torch.Tensor]:
        """Returns PPO's loss and its parts."""
        config = self._config
        *situation, action, log_probability, advantage, wanted = rows.parts
        log_probabilities, value, scalars = self.actor.evaluated(rows._replace(parts=tuple(situation)))
        taken = log_probabilities.gather(1, action[:, None])[:, 0]
        policy_loss = clipped_loss(taken - log_probability, advantage, config.clip)
        value_loss = functional.mse_loss(value, wanted)
        loss = policy_loss + config.value_weight * value_loss - config.entropy_weight * scalars["entropy"]
        return {"loss": loss, "policy_loss": policy_loss, "value_loss": value_loss, **scalars}


def advantages(
    reward: np.ndarray, value: np.ndarray, terminated: np.ndarray, ended: np.ndarray, discount: float, trace: float
) -> np.ndarray:
    """Returns generalized advantage estimates `[T - 1, B]` (Schulman et al. 2016, eq. 16) of all steps but the last.

    Where an episode was cut short, the value of the state before its last step stands for all rewards that follow.
    Arrays are `[T, B]`: the value is that of the state before each step; a step that `terminated` reached the goal.
    """
    found, following = np.zeros_like(value), np.zeros_like(value[0])
    for step in range(len(value) - 2, -1, -1):
        next_value = np.where(ended[step], np.where(terminated[step], 0.0, value[step]), value[step + 1])
        error = reward[step] + discount * next_value - value[step]
        found[step] = following = error + discount * trace * ~ended[step] * following
    return found[:-1]


def clipped_loss(log_ratio: torch.Tensor, advantage: torch.Tensor, clip: float) -> torch.Tensor:
    """Returns PPO's loss (Schulman et al. 2017, eq. 7), with advantages scaled to a mean of 0 and a deviation of 1."""
    scaled = (advantage - advantage.mean()) / (advantage.std(correction=0) + 1e-6)
    ratio = log_ratio.exp()
    return -torch.minimum(ratio * scaled, ratio.clamp(1 - clip, 1 + clip) * scaled).mean()
