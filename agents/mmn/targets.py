"""What values and policies of MMN learn: the config names the targets.

`G` is the number of contexts in a batch, `S` of sequences in each, `T` of steps of a sequence, so T + 1 of states.
"""

from __future__ import annotations

from typing import NamedTuple

import torch

from mazebench.constants import NUM_ACTIONS

from .batches import Batch
from .config import MMNConfig
from .network import Code, MMNNetwork, reward_and_discount, rows_of
from .planning import plan


class Targets(NamedTuple):
    """The targets of the heads for the states of a batch."""

    value: torch.Tensor  # [G, S, T + 1]
    policy: torch.Tensor  # [G, S, T + 1, 6]


@torch.no_grad()
def targets_of(network: MMNNetwork, config: MMNConfig, batch: Batch) -> Targets:
    """Returns the targets of a batch by the target network; the batch's goals are real or relabelled."""
    states = batch.exists.shape[1:]
    code = network.hypermodel(batch.context, batch.anchor)
    latent = network.encode(batch.features.flatten(1, 2))  # [G, S (T + 1), D]
    predictions = network.predict(latent, network.look(latent, code), code)

    if config.value_target == "tree_backup" or config.policy_target == "lookahead":
        qvalues = lookahead(network, latent, code).unflatten(1, states)
        policy = torch.softmax(qvalues / config.temperature, dim=-1)

    if config.value_target == "tree_backup":
        value = tree_backup_returns(qvalues, policy, batch.action, batch.at_goal, batch.exists)
    else:
        bootstrap = network.value(predictions.value_logits).unflatten(1, states)
        value = n_step_returns(bootstrap, batch.at_goal, batch.exists, config.n_step)

    if config.policy_target != "lookahead":
        policy = torch.softmax(predictions.policy_logits, dim=-1)
        # With the policy target "paper", relabelled contexts keep the network's own policy.
        searched = ~batch.relabelled if config.policy_target == "paper" else torch.ones_like(batch.relabelled)
        if searched.any():
            result = plan(network, config, latent[searched], rows_of(code, searched), config.num_simulations)
            weights = torch.from_numpy(result.action_weights).to(policy.device)
            policy[searched] = weights.unflatten(0, (-1, policy.shape[1]))
        policy = policy.unflatten(1, states)

    return Targets(value.clamp(-config.longest_value, 0.0), policy)


def lookahead(network: MMNNetwork, latent: torch.Tensor, code: Code) -> torch.Tensor:
    """Returns action values `[G, K, 6]` of latent states `[G, K, D]` by one step of the model."""
    first = network.first_layer(latent, network.look(latent, code), code)
    # Every action of a state; those of one state are neighbours.
    action = torch.arange(NUM_ACTIONS, device=latent.device).repeat(latent.shape[1]).expand(len(latent), -1)
    before, first = (values.repeat_interleave(NUM_ACTIONS, dim=1) for values in (latent, first))
    after = network.step(before, first, action, code)  # [G, 6 K, D]
    predictions = network.predict(after, network.look(after, code), code)
    reward, discount = reward_and_discount(predictions)
    qvalues = reward + discount * network.value(predictions.value_logits)
    return qvalues.unflatten(1, (-1, NUM_ACTIONS))


def tree_backup_returns(
    qvalues: torch.Tensor, policy: torch.Tensor, action: torch.Tensor, at_goal: torch.Tensor, exists: torch.Tensor
) -> torch.Tensor:
    """Returns values `[..., T + 1]` of `policy` by tree backup along the experience (Precup et al. 2000).

    In each state, the estimated value of the action that was taken is replaced by its outcome: -1 plus the return from
    the next state, or 0 if the action reached the goal. The other actions keep their estimated values.

    Args:
      qvalues: `[..., T + 1, 6]`, estimated action values.
      policy: `[..., T + 1, 6]`, whose values are estimated.
      action: `[..., T]`, the actions taken.
      at_goal: `[..., T + 1]` bool, whether the goal is reached in this state.
      exists: `[..., T + 1]` bool, whether the sequence goes as far; its last state has its estimated value.
    """
    expected = (policy * qvalues).sum(dim=-1)
    taken = action[..., None]
    chance = policy[..., :-1, :].gather(-1, taken)[..., 0]
    estimated = qvalues[..., :-1, :].gather(-1, taken)[..., 0]
    returns = [expected[..., -1]]
    for t in range(action.shape[-1] - 1, -1, -1):
        outcome = torch.where(at_goal[..., t + 1], 0.0, returns[-1] - 1)
        backed_up = expected[..., t] + chance[..., t] * (outcome - estimated[..., t])
        returns.append(torch.where(exists[..., t + 1], backed_up, expected[..., t]))
    return torch.stack(returns[::-1], dim=-1)


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
