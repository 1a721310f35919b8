"""The learner of MMN: sequences with goals relabelled in hindsight, along which the model is unrolled."""

from __future__ import annotations

from typing import Any

import torch

from mazebench.tasks.task import Task

from ..common import symmetry
from ..common.actor import one_torch_thread
from ..common.descent import Descent, in_numbers
from ..common.learner import HindsightLearner
from .losses import q_losses, unrolled_losses
from .targets import make_batch, targets_of


class MMNLearner(HindsightLearner):
    """Updates the network of its actor."""

    def __init__(self, actor: Any, task: Task, seed: int):
        # Groups of parameters, whose `rate` multiplies the learning rate.
        config, network = actor.config, actor.network
        hyper, scale = network.hypermodel.hyper.weight, network.scale
        others = [parameter for parameter in network.parameters() if parameter is not hyper and parameter is not scale]
        groups = [
            {"params": others, "rate": 1.0},
            {"params": [hyper], "rate": config.hyper_rate},
            {"params": [scale], "rate": config.scale_rate},
        ]
        descent = Descent(
            network,
            torch.optim.AdamW(groups, lr=config.learning_rate, weight_decay=config.weight_decay),
            max_gradient_norm=config.max_gradient_norm,
            target_rate=config.target_rate,
            rate=lambda step: min(1.0, config.constant_updates / step),
        )
        super().__init__(actor, task, seed, descent, keep_anchor=True)

    @one_torch_thread()
    def update(self) -> dict[str, float]:
        """Learns from one batch; returns its losses and, to judge a run early, other scalars by name."""
        config, network = self.actor.config, self.actor.network

        # Some sequences of the replay, most of their goals relabelled, as they are in the turned world.
        sample = self.replay.sample_sequences(
            config.groups, config.sequences, config.sequence_steps, hindsight=self.hindsight, rng=self.rng
        )
        turned = int(self.rng.integers(symmetry.NUM_SYMMETRIES)) if config.symmetries else 0
        batch = make_batch(sample, maps=self.maps, turned=turned, device=network.support.device)

        if config.model:
            # Targets of values and policies in all states, by the target network.
            targets = targets_of(self.descent.target, config, batch)

            # Losses of the model, unrolled from some of the states.
            losses, metrics = unrolled_losses(network, config, batch, targets)
        else:
            losses, metrics = q_losses(network, self.descent.target, config, batch)

        metrics["gradient_norm"] = self.descent.step(torch.stack(list(losses.values())).sum())
        return in_numbers(losses | metrics)
