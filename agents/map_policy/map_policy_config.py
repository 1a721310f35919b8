"""The config of the map policy's training, with the reason for each number."""

from __future__ import annotations

import dataclasses

from ..common.config_values import Count, Factor, Length, Share
from ..imitation import DriveSteps, ImitationConfig


@dataclasses.dataclass(frozen=True, kw_only=True)
class MapPolicyConfig(ImitationConfig):
    """Sized for one core: 80,000 steps in a quarter of an hour. Nothing in it changes how a trained network acts."""

    # A network that can't drive yet stays where it begins: its drives show few places of few maps.
    oracle_drives: Share = 1.0
    drive_steps: DriveSteps = 25  # as many as a rollout has, so that each map has a row of states in it
    num_envs: Count = 64
    rollout_steps: Length = 25  # a map is read once for as many steps; the default milestones end rollouts
    epochs: Length = 5  # a step is learned from in so many minibatches, of some 16 maps each
    minibatches: Length = 4
    learning_rate: Factor = 1e-3
    max_gradient_norm: Factor = 1.0
