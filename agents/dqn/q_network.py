"""The Q-network of the state, to which a network that reads contexts adds inputs.

`G` is the number of contexts, `K` of states in each.
"""

from __future__ import annotations

from typing import ClassVar

import torch
from torch import nn

from mazebench.constants import NUM_ACTIONS

from ..common.layers import dueling_values

NUM_STATE_FEATURES = 7
# Contexts and states are computed as many at once, always, since PyTorch rounds differently at another batch size.
CONTEXTS_AT_ONCE = 8  # few are new in one step
STATES_AT_ONCE = 64


class QNetwork(nn.Module):
    """Dueling action values (Wang et al. 2016) of the state alone; subclasses add what they read of a context."""

    reads_context: ClassVar[bool] = False

    def __init__(self, hidden: int, num_read: int = 0):
        """`num_read` is the number of inputs from a context."""
        super().__init__()
        num_inputs = NUM_STATE_FEATURES + num_read
        self.body = nn.Sequential(nn.Linear(num_inputs, hidden), nn.ReLU(), nn.Linear(hidden, hidden), nn.ReLU())
        self.value = nn.Linear(hidden, 1)
        self.advantage = nn.Linear(hidden, NUM_ACTIONS)

    def forward(self, state: torch.Tensor, code: torch.Tensor | None = None) -> torch.Tensor:
        """Returns action values `[G, K, 6]` of states `[G, K, 9]` (see `state_features`) in encoded contexts."""
        features = state[..., 2:]
        if code is not None:
            features = torch.cat([features, self.read(state[..., :2], code)], dim=-1)
        hidden = self.body(features)
        return dueling_values(self.value(hidden), self.advantage(hidden))

    def encode(self, context: torch.Tensor) -> torch.Tensor:
        """Returns codes `[G, ...]` of contexts `[G, 4, M, M]`."""
        raise NotImplementedError

    def read(self, moved: torch.Tensor, code: torch.Tensor) -> torch.Tensor:
        """Returns inputs `[G, K, ...]` from encoded contexts, after displacements `moved` `[G, K, 2]` (m)."""
        raise NotImplementedError
