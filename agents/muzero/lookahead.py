"""One step of lookahead in a latent model.

`G` is the number of contexts, `K` of latent states in each.
"""

from __future__ import annotations

import torch

from .network import NUM_ACTIONS, Code, Network, Predictions


def outcome(predictions: Predictions) -> tuple[torch.Tensor, torch.Tensor]:
    """Returns reward and discount `[G, K]` of arriving in states: a goal ends the episode, any other step costs 1."""
    discount = torch.sigmoid(-predictions.goal_logit)
    return -discount, discount


def lookahead(network: Network, latent: torch.Tensor, code: Code) -> torch.Tensor:
    """Returns action values `[G, K, 6]` of latent states `[G, K, D]` by one step of the model."""
    first = network.first_layer(latent, network.look(latent, code), code)
    after = network.step_all(latent, first, code)
    predictions = network.predict(after, network.look(after, code), code)
    reward, discount = outcome(predictions)
    qvalues = reward + discount * network.value(predictions.value_logits)
    return qvalues.unflatten(1, (-1, NUM_ACTIONS))
