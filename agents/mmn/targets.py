"""What MMN's values and policies are learned from; the mathematics apart from networks and replay.

`T` is the number of steps of a sequence, which has T + 1 states.
"""

from __future__ import annotations

import torch
from torch.nn import functional


def tree_backup_returns(
    qvalues: torch.Tensor, policy: torch.Tensor, action: torch.Tensor, at_goal: torch.Tensor, exists: torch.Tensor
) -> torch.Tensor:
    """`[..., T + 1]`: values of `policy`, backed up along what was experienced (Precup et al. 2000, tree backup).

    In each state, the believed value of the action that was taken is replaced by what came of it: -1 and the return
    from the next state, or 0 if it reached the goal. The other actions keep their believed values.

    Args:
      qvalues: `[..., T + 1, 6]`, believed action values.
      policy: `[..., T + 1, 6]`, whose values are estimated.
      action: `[..., T]`, the actions taken.
      at_goal: `[..., T + 1]` bool, the goal is reached in this state.
      exists: `[..., T + 1]` bool, the sequence goes as far; from its last state on, beliefs are all there is.
    """
    expected = (policy * qvalues).sum(dim=-1)
    taken = action[..., None]
    chance = policy[..., :-1, :].gather(-1, taken)[..., 0]
    believed = qvalues[..., :-1, :].gather(-1, taken)[..., 0]
    returns = [expected[..., -1]]
    for t in range(action.shape[-1] - 1, -1, -1):
        came = torch.where(at_goal[..., t + 1], 0.0, returns[-1] - 1)
        backed_up = expected[..., t] + chance[..., t] * (came - believed[..., t])
        returns.append(torch.where(exists[..., t + 1], backed_up, expected[..., t]))
    return torch.stack(returns[::-1], dim=-1)


def n_step_returns(value: torch.Tensor, at_goal: torch.Tensor, exists: torch.Tensor, n: int) -> torch.Tensor:
    """`[..., T + 1]`: n-step returns, -1 a step until the goal, and after n steps the value of the state reached.

    The paper's n-step relabelled targets: a step into the goal is rewarded 0 and ends the return. One that would go
    beyond the sequence, or its last existing state, is shorter.

    Args:
      value: `[..., T + 1]`, to bootstrap from.
      at_goal: `[..., T + 1]` bool, the goal is reached in this state.
      exists: `[..., T + 1]` bool, the sequence goes as far.
      n: steps.
    """
    returns = value
    for _ in range(n):
        came = torch.where(at_goal[..., 1:], 0.0, returns[..., 1:] - 1)
        returns = torch.cat([torch.where(exists[..., 1:], came, value[..., :-1]), value[..., -1:]], dim=-1)
    return returns


def two_hot(value: torch.Tensor, num_bins: int) -> torch.Tensor:
    """`[..., bins]`: values `[...]` as weights of the two whole numbers of [1 - bins, 0] next to each."""
    position = (value + (num_bins - 1)).clamp(0, num_bins - 1)
    low = position.floor().clamp(max=num_bins - 2)
    share = (position - low)[..., None]
    low = low.long()
    return functional.one_hot(low, num_bins) * (1 - share) + functional.one_hot(low + 1, num_bins) * share


def cross_entropy(target: torch.Tensor, logits: torch.Tensor) -> torch.Tensor:
    """`[...]`: of predicted logits under target probabilities, both `[..., n]`."""
    return -(target * logits.log_softmax(dim=-1)).sum(dim=-1)


def scale_gradient(tensor: torch.Tensor, scale: float) -> torch.Tensor:
    """`tensor`, whose gradient is scaled: MuZero halves that of unrolled states at each step."""
    return tensor * scale + tensor.detach() * (1 - scale)
