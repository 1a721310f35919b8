"""Targets of the values and policies of MMN.

`G` is the number of contexts in a batch, `S` of sequences in each, `T` of steps of a sequence, so T + 1 of states.
"""

from __future__ import annotations

from typing import NamedTuple

import torch

from .batches import Batch
from .hypermodel import MMNNetwork
from .mmn_config import MMNConfig
from .search_policy import plan


class Targets(NamedTuple):
    """The targets of the heads for the states of a batch."""

    value: torch.Tensor  # [G, S, T + 1]
    policy: torch.Tensor  # [G, S, T + 1, 6]


@torch.no_grad()
def targets_of(network: MMNNetwork, config: MMNConfig, batch: Batch) -> Targets:
    """Returns the targets of a batch by the target network: n-step values, and the policies that a search finds."""
    states = batch.exists.shape[1:]
    code = network.hypermodel(batch.context, batch.anchor)
    latent = network.encode(batch.features.flatten(1, 2))  # [G, S (T + 1), D]

    predictions = network.predict(latent, network.look(latent, code), code)
    bootstrap = network.value(predictions.value_logits).unflatten(1, states)
    value = n_step_returns(bootstrap, batch.at_goal, batch.exists, config.n_step)

    weights = plan(network, config, latent, code, config.num_simulations).action_weights
    policy = torch.from_numpy(weights).to(latent.device).unflatten(0, (-1, *states))
    return Targets(value.clamp(-config.longest_value, 0.0), policy)


def n_step_returns(value: torch.Tensor, at_goal: torch.Tensor, exists: torch.Tensor, n: int) -> torch.Tensor:
    """Returns the paper's n-step returns `[..., T + 1]`: -1 a step, and after n steps the value of the state reached.

    A step into the goal is rewarded 0 and ends the return. A return ends early at the last existing state.

    Args:
      value: `[..., T + 1]`, to bootstrap from.
      at_goal: `[..., T + 1]` bool, whether the goal is reached in this state.
      exists: `[..., T + 1]` bool, whether the sequence goes as far.
      n: steps.
    """
    returns = value
    for _ in range(n):
        outcome = torch.where(at_goal[..., 1:], 0.0, returns[..., 1:] - 1)
        returns = torch.cat([torch.where(exists[..., 1:], outcome, value[..., :-1]), value[..., -1:]], dim=-1)
    return returns
