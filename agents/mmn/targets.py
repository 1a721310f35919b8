"""The targets of values, as functions without networks and replay.

`T` is the number of steps of a sequence, which has T + 1 states.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch.nn import functional


class Targets(NamedTuple):
    """The targets of the heads for the states of a batch: of S sequences in each of G contexts."""

    value: torch.Tensor  # [G, S, T + 1]
    policy: torch.Tensor  # [G, S, T + 1, 6]


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


def two_hot(value: torch.Tensor, num_bins: int) -> torch.Tensor:
    """Returns values `[...]` as weights `[..., bins]` of the two nearest integers in [1 - bins, 0]."""
    position = (value + (num_bins - 1)).clamp(0, num_bins - 1)
    low = position.floor().clamp(max=num_bins - 2)
    share = (position - low)[..., None]
    low = low.long()
    return functional.one_hot(low, num_bins) * (1 - share) + functional.one_hot(low + 1, num_bins) * share


def cross_entropy(target: torch.Tensor, logits: torch.Tensor) -> torch.Tensor:
    """Returns the cross-entropy `[...]` of logits under target probabilities, both `[..., n]`."""
    return -(target * logits.log_softmax(dim=-1)).sum(dim=-1)


def scale_gradient(tensor: torch.Tensor, scale: float) -> torch.Tensor:
    """Returns `tensor` with its gradient scaled; MuZero halves that of unrolled states at each step."""
    return tensor * scale + tensor.detach() * (1 - scale)
