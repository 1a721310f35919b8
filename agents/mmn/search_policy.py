"""Tree search in the latent model of MMN.

`G` is the number of contexts, `K` of latent states in each, B = G K.
"""

from __future__ import annotations

import numpy as np
import torch

from mazebench.constants import NUM_ACTIONS

from ..muzero.search import RecurrentFn, Root, SearchResult, gumbel_muzero_policy
from ..muzero.tree import Evaluation
from .hypermodel import Code, MMNNetwork, Predictions
from .kernel_model import kernel_model
from .mmn_config import MMNConfig


@torch.no_grad()
def plan(
    network: MMNNetwork,
    config: MMNConfig,
    latent: torch.Tensor,
    code: Code,
    num_simulations: int,
    rng: np.random.Generator | None = None,
    noise_scale: np.ndarray | float = 1.0,
) -> SearchResult:
    """Searches from all latent states `[G, K, D]`; the results are in the order of B.

    If `rng` is given, the search has Gumbel noise, multiplied by `noise_scale`, a number or `[B]`.
    """
    size = latent.shape[0] * latent.shape[1], NUM_ACTIONS
    gumbel = np.zeros(size) if rng is None else rng.gumbel(size=size)
    root, model = (kernel_model if latent.is_cpu else torch_model)(network, latent, code)
    return gumbel_muzero_policy(
        root,
        model,
        num_simulations,
        gumbel * np.broadcast_to(noise_scale, size[:1])[:, None],
        value_scale=config.value_scale,
        maxvisit_init=config.maxvisit_init,
    )


def torch_model(network: MMNNetwork, latent: torch.Tensor, code: Code) -> tuple[Root, RecurrentFn]:
    """Returns roots and model of a search from latent states `[G, K, D]` on any device."""
    shape, sizes = latent.shape[:2], [network.latent_size, network.hidden_size]

    def arrive(latent: torch.Tensor) -> tuple[Predictions, torch.Tensor]:
        """Returns predictions for latent states, and embeddings `[B, D + H]`: states and first layers."""
        seen = network.look(latent, code)
        embedding = torch.cat([latent, network.first_layer(latent, seen, code)], dim=-1)
        return network.predict(latent, seen, code), embedding.flatten(0, 1)

    def step(embedding: torch.Tensor, action: np.ndarray) -> tuple[Evaluation, torch.Tensor]:
        latent, first = embedding.unflatten(0, shape).split(sizes, dim=-1)
        chosen = torch.from_numpy(action).to(embedding.device).unflatten(0, shape)
        predictions, after = arrive(network.step(latent, first, chosen, code))
        discount = torch.sigmoid(-predictions.goal_logit)  # a goal ends the episode, any other step costs 1
        value = network.value(predictions.value_logits)
        return Evaluation(*_arrays(-discount, discount, predictions.policy_logits, value)), after

    predictions, embedding = arrive(latent)
    prior_logits, value = _arrays(predictions.policy_logits, network.value(predictions.value_logits))
    return Root(prior_logits, value, embedding), step


def _arrays(*tensors: torch.Tensor) -> list[np.ndarray]:
    """Returns tensors `[G, K, ...]` as arrays `[B, ...]`, copied from their device at once."""
    rows = [tensor.flatten(0, 1) for tensor in tensors]
    copied = torch.cat([row.reshape(len(row), -1) for row in rows], dim=1).float().cpu()
    parts = copied.split([row[0].numel() for row in rows], dim=1)
    return [part.reshape(row.shape).contiguous().numpy() for part, row in zip(parts, rows, strict=True)]
