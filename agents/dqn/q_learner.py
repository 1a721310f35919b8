"""The learner of DQN and MAH: double n-step targets on relabelled experience, drawn by priority.

`G` groups of `K` steps make a batch; the steps of a group share one context.
"""

from __future__ import annotations

import numpy as np
import torch
from torch.nn import functional

from mazebench.tasks.task import Task

from ..common import symmetry
from ..common.actor import NetworkAgent, one_torch_thread
from ..common.descent import Descent, in_numbers
from ..common.layers import state_features
from ..common.learner import HindsightLearner


class DQNLearner(HindsightLearner):
    """Updates the Q-network of its actor."""

    def __init__(self, actor: NetworkAgent, task: Task, seed: int):
        config = actor.config
        descent = Descent(
            actor.network,
            torch.optim.Adam(actor.network.parameters(), lr=config.learning_rate),
            max_gradient_norm=config.max_gradient_norm,
            target_rate=config.target_rate,
        )
        super().__init__(actor, task, seed, descent, priority_exponent=config.priority_exponent)

    @one_torch_thread()
    def update(self) -> dict[str, float]:
        """Learns from one batch; returns its losses and other scalars by name."""
        config, network, target_network = self.actor.config, self.actor.network, self.descent.target

        # Some rows of the replay, most of their goals relabelled, as they are in the turned world.
        sample = self.replay.sample(
            config.groups,
            config.steps,
            config.n_step,
            hindsight=self.hindsight,
            rng=self.rng,
            beta=config.importance_exponent,
        )
        turned = int(self.rng.integers(symmetry.NUM_SYMMETRIES)) if config.symmetries else 0
        origin = torch.from_numpy(sample.contexts.origin)[:, None]
        features, next_features = (
            symmetry.turn_features(state_features(torch.from_numpy(state), origin), turned)
            for state in (sample.state, sample.next_state)
        )
        action = torch.from_numpy(symmetry.turn_actions(np.maximum(sample.action, 0), turned))

        # Their contexts, encoded by both networks; none without context.
        code = target_code = None
        if network.reads_context:
            contexts = self.maps.contexts(sample.contexts, turned)
            code = network.encode(contexts)
            with torch.no_grad():
                target_code = target_network.encode(contexts)

        # Targets, clipped to the values that are possible.
        with torch.no_grad():
            target = double_q_target(
                r_t=torch.from_numpy(sample.reward),
                discount_t=torch.from_numpy(sample.discount),
                q_t_value=target_network(next_features, target_code),
                q_t_selector=network(next_features, code),
            ).clamp(-config.longest_value, 0.0)

        # Losses.
        q_tm1 = network(features, code).gather(-1, action[..., None])[..., 0]
        valid = torch.from_numpy(sample.valid).float()
        weight = torch.from_numpy(sample.weight)[:, None] * valid
        td_loss = (weight * functional.smooth_l1_loss(q_tm1, target, reduction="none")).sum() / valid.sum().clamp(min=1)
        metrics = {"td_loss": td_loss, "q": q_tm1.mean()}
        loss = td_loss
        if code is not None and config.reading:
            # In cells, of the estimated positions on the map.
            error = network.locate(features[..., :2], code) - self.maps.positions(sample.cell, turned)
            metrics["localization_error"] = error.abs().mean()
            loss = loss + config.localization_weight * metrics["localization_error"]

        metrics["gradient_norm"] = self.descent.step(loss)

        # The first step of a group is the row that was drawn. A row that was not learned from keeps its priority.
        seen = sample.valid[:, 0]
        self.replay.update_priorities(sample.row[seen], (q_tm1 - target).detach().numpy()[seen, 0])
        return in_numbers(metrics)


def double_q_target(
    r_t: torch.Tensor, discount_t: torch.Tensor, q_t_value: torch.Tensor, q_t_selector: torch.Tensor
) -> torch.Tensor:
    """Returns r + discount * q_value(argmax q_selector), `[...]` (van Hasselt et al. 2016, eq. 4).

    The values `[..., 6]` are the target network's, and those of the selector the online network's.
    """
    best = q_t_selector.argmax(dim=-1, keepdim=True)
    return r_t + discount_t * q_t_value.gather(-1, best)[..., 0]
