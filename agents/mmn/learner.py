"""The learner of MMN: sequences with goals relabelled in hindsight, a model that is unrolled along them, and targets of
values and policies that the config names.

`G` is the number of contexts in a batch, `S` of sequences in each, `L` of steps of a sequence, so L + 1 of states.
"""

from __future__ import annotations

from typing import Any

import torch

from mazebench.tasks.spec import TaskSpec

from ..common import symmetry
from ..common.actor import one_torch_thread
from ..common.descent import in_numbers
from ..common.learner import HindsightLearner
from ..muzero.batches import Batch, make_batch
from ..muzero.descent import make_descent
from ..muzero.lookahead import lookahead_targets
from ..muzero.losses import unrolled_losses
from ..muzero.network import Code, Predictions, rows_of
from ..muzero.targets import Targets, n_step_returns
from .config import MMNConfig
from .network import MMNNetwork
from .planning import plan


class MMNLearner(HindsightLearner):
    """Updates the network of its actor."""

    def __init__(self, actor: Any, task: TaskSpec, seed: int):
        descent = make_descent(actor.network, actor.config)
        super().__init__(actor, task, seed, descent, keep_anchor=actor.config.keep_anchor)

    @one_torch_thread()
    def update(self) -> dict[str, float]:
        """Learns from one batch; returns its losses and, to judge a run early, other scalars by name."""
        config, network = self.actor.config, self.actor.network

        # Some sequences of the replay, most of their goals relabelled, as they are in the turned world.
        sample = self.replay.sample_sequences(
            config.groups, config.sequences, config.sequence_steps, hindsight=self.hindsight, rng=self.rng
        )
        turned = int(self.rng.integers(symmetry.NUM_SYMMETRIES)) if config.symmetries else 0
        contexts = self.maps.contexts(sample, turned)
        batch = make_batch(sample, maps=self.maps, turned=turned, context=contexts, device=network.support.device)

        # Targets of values and policies in all states, by the target network.
        targets = targets_of(self.descent.target, config, batch)

        # Losses of the model, unrolled from some of the states.
        losses, metrics = unrolled_losses(network, config, batch, targets)

        metrics["gradient_norm"] = self.descent.step(torch.stack(list(losses.values())).sum())
        return in_numbers(losses | metrics)


@torch.no_grad()
def targets_of(network: MMNNetwork, config: MMNConfig, batch: Batch) -> Targets:
    """Returns the targets of a batch by the target network; the batch's goals are real or relabelled."""
    code = network.hypermodel(batch.context, batch.anchor)
    latent = network.encode(batch.features.flatten(1, 2))  # [G, S (L + 1), D]

    if config.value_target == "tree_backup" or config.policy_target == "lookahead":
        value, policy = lookahead_targets(network, config, batch, latent, code)

    if config.value_target == "n_step":
        bootstrap = network.value(_predict(network, latent, code).value_logits).unflatten(1, batch.exists.shape[1:])
        value = n_step_returns(bootstrap, batch.at_goal, batch.exists, config.n_step)

    if config.policy_target != "lookahead":
        policy = torch.softmax(_predict(network, latent, code).policy_logits, dim=-1)
        # With the policy target "paper", relabelled contexts keep the network's own policy.
        searched = ~batch.relabelled if config.policy_target == "paper" else torch.ones_like(batch.relabelled)
        if searched.any():
            result = plan(network, config, latent[searched], rows_of(code, searched), config.num_simulations)
            weights = torch.from_numpy(result.action_weights).to(policy.device)
            policy[searched] = weights.unflatten(0, (-1, policy.shape[1]))
        policy = policy.unflatten(1, batch.exists.shape[1:])

    return Targets(value.clamp(-config.longest_value, 0.0), policy)


def _predict(network: MMNNetwork, latent: torch.Tensor, code: Code) -> Predictions:
    return network.predict(latent, network.look(latent, code), code)
