"""The gradient steps of a network with a latent model."""

from __future__ import annotations

import torch

from ..common.descent import Descent
from .config import MuZeroConfig
from .network import Network


def make_descent(network: Network, config: MuZeroConfig) -> Descent:
    """Returns steps of AdamW, with the rates of the network's groups of parameters."""
    groups = network.parameter_groups()
    return Descent(
        network,
        torch.optim.AdamW(groups, lr=config.learning_rate, weight_decay=config.weight_decay),
        max_gradient_norm=config.max_gradient_norm,
        target_rate=config.target_rate,
        constant_steps=config.constant_updates,
    )
