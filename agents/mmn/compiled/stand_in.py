"""The network that `measure` compares with mctx's, as kernels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .parts import Heads, add_product, kernel, normalize, predict, rectify, scratch


class StandIn(NamedTuple):
    """What the kernels take."""

    transition_1: np.ndarray  # [B, inputs and actions, D], of each root
    transition_2: np.ndarray  # [B, D, D]
    num_bins: int
    heads: Heads


def step(
    model: StandIn,
    first: int,
    embeddings: np.ndarray,
    parents: np.ndarray,
    actions: np.ndarray,
    index: int,
    numbers: np.ndarray,
) -> None:
    """Takes a step in each tree."""
    num_latent = embeddings.shape[2]
    hidden = np.empty(num_latent, np.float32)
    for b in range(len(embeddings)):
        before, after, weights = embeddings[b, parents[b]], embeddings[b, index], model.transition_1[first + b]
        hidden[:] = weights[num_latent + actions[b]]
        add_product(before, weights[:num_latent], hidden)
        rectify(hidden)
        after[:] = before
        add_product(hidden, model.transition_2[first + b], after)
        normalize(after)
    arrive(model, first, embeddings, index, numbers)


@kernel
def arrive(model: StandIn, first: int, embeddings: np.ndarray, index: int, numbers: np.ndarray) -> None:
    """Writes the predictions for the latent states in `embeddings[:, index]`."""
    inputs = scratch(len(embeddings), embeddings.shape[2])
    inputs[: len(embeddings)] = embeddings[:, index]
    predict(inputs, model.heads, model.num_bins, numbers, len(embeddings))
