"""The learner of MMN, with the targets of values and policies that its config names."""

from __future__ import annotations

from typing import Any

import torch

from mazebench.maps.maze import Maze

from ..muzero.learner import MuZeroLearner
from ..muzero.losses import Batch, Targets
from ..muzero.network import Code, Network, Predictions, rows_of
from ..muzero.targets import n_step_returns
from .planning import plan


class MMNLearner(MuZeroLearner):
    """Updates the network of its actor."""

    def __init__(self, actor: Any, mazes: tuple[Maze, ...], seed: int):
        super().__init__(actor, mazes, seed, actor.config.keep_anchor)

    @torch.no_grad()
    def _targets(self, batch: Batch) -> Targets:
        """Returns the targets of the batch by the target network; its goals are real or relabelled."""
        network, config = self._target, self._config
        code = network.hypermodel(batch.context, batch.anchor)
        latent = network.encode(batch.features.flatten(1, 2))
        if config.value_target == "tree_backup" or config.policy_target == "lookahead":
            value, policy = self._lookahead_targets(batch, latent, code)
        if config.value_target == "n_step":
            bootstrap = network.value(self._predict(network, latent, code).value_logits)
            bootstrap = bootstrap.unflatten(1, batch.exists.shape[1:])
            value = n_step_returns(bootstrap, batch.at_goal, batch.exists, config.n_step)
        if config.policy_target != "lookahead":
            policy = self._searched(batch, latent, code)
        return Targets(value.clamp(-config.longest_value, 0.0), policy)

    def _searched(self, batch: Batch, latent: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns policies `[G, S, L + 1, 6]` by search.

        With the policy target "paper", relabelled contexts get the network's own policy instead.
        """
        network, config = self._target, self._config
        policy = torch.softmax(self._predict(network, latent, code).policy_logits, dim=-1)
        searched = ~batch.relabelled if config.policy_target == "paper" else torch.ones_like(batch.relabelled)
        if searched.any():
            result = plan(network, config, latent[searched], rows_of(code, searched), config.num_simulations)
            weights = torch.from_numpy(result.action_weights).to(policy.device)
            policy[searched] = weights.unflatten(0, (-1, policy.shape[1]))
        return policy.unflatten(1, batch.features.shape[1:3])

    def _predict(self, network: Network, latent: torch.Tensor, code: Code) -> Predictions:
        return network.predict(latent, network.look(latent, code), code)
