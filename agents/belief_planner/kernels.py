"""The model of MMN as kernels; they equal `spatial.BeliefPlannerNetwork` up to rounding."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..mmn.compiled.parts import (
    TURN,
    Contexts,
    Heads,
    Layer,
    Linear,
    act,
    affine,
    kernel,
    locate,
    moments,
    move,
    move_freely,
    predict,
    read,
    rectify,
    scratch,
)

_LEAST_FREE = np.float32(0.1)  # as in `spatial`
_FREQUENCIES = (np.float32(0.25), np.float32(0.5), np.float32(1.0), np.float32(2.0))  # of `layers.waves`


class SpatialModel(NamedTuple):
    """What the kernels of MMN take; see `spatial.BeliefPlannerNetwork`."""

    contexts: Contexts
    num_bins: int  # of categorical values
    num_ways: int  # numbers of a cell that are read of free cells only
    scale: np.ndarray
    sharpness: np.ndarray  # [1], after softplus
    free: Linear
    free_by_action: np.ndarray
    ahead: Linear
    inputs: Layer
    actions: np.ndarray
    later_1: Layer
    later_2: Layer
    normalize: Linear  # weight [1, D - 7]
    heads: Heads


def step(
    model: SpatialModel,
    first: int,
    embeddings: np.ndarray,
    parents: np.ndarray,
    actions: np.ndarray,
    index: int,
    numbers: np.ndarray,
) -> None:
    """Takes a step in each tree."""
    num_rows, num_hidden = len(embeddings), len(model.ahead.bias)
    num_latent = embeddings.shape[2] - num_hidden
    free, change = np.empty((num_rows, 6), np.float32), scratch(num_rows, len(model.later_2.bias))
    hidden_1, hidden_2 = scratch(num_rows, num_hidden), scratch(num_rows, len(model.later_1.bias))
    for b in range(num_rows):
        before, a = embeddings[b, parents[b]], actions[b]
        move_freely(before, model.free.weight, model.free.bias, model.free_by_action[a], free[b])
        act(before, num_latent, free[b], model.ahead.weight, model.ahead.bias, model.actions[a], hidden_1[b])
        rectify(hidden_1[b])
    affine(hidden_1, model.later_1, True, hidden_2)
    affine(hidden_2, model.later_2, False, change)
    for b in range(num_rows):
        before, after = embeddings[b, parents[b]], embeddings[b, index]
        move(before, free[b], change[b], after)
        for j in range(7, num_latent):
            after[j] = before[j] + change[b, 3 + j]
        motion = after[7:num_latent]
        mean, factor = moments(motion)
        for j in range(len(motion)):
            motion[j] = (motion[j] - mean) * factor * model.normalize.weight[0, j] + model.normalize.bias[j]
    arrive(model, first, embeddings, index, numbers)


@kernel
def arrive(model: SpatialModel, first: int, embeddings: np.ndarray, index: int, numbers: np.ndarray) -> None:
    """Writes the first layers of the latent states in `embeddings[:, index]` beside them, and the predictions."""
    contexts, num_rows = model.contexts, len(embeddings)
    num_hidden = len(model.ahead.bias)
    num_latent = embeddings.shape[2] - num_hidden
    seen = np.empty((num_rows, contexts.table.shape[2]), np.float32)
    hidden = scratch(num_rows, len(model.inputs.bias))
    inputs = scratch(num_rows, model.heads.body_1.weight.shape[1])
    for b in range(num_rows):
        latent, x, c = embeddings[b, index], inputs[b], (first + b) // contexts.num_roots
        positions = contexts.positions[c]
        row, column = locate(model.scale, positions, latent)
        read(row, column, contexts.table[c], model.sharpness[0], seen[b])
        last = seen.shape[1] - 1
        free = max(seen[b, last], _LEAST_FREE)
        for i in range(last - model.num_ways, last):
            seen[b, i] /= free
        for i in range(num_latent - 2):
            x[i] = latent[2 + i]
        k = num_latent - 2
        for axis in range(2):
            for i in range(4):
                phase = TURN * latent[axis] * _FREQUENCIES[i]
                x[k + i], x[k + 4 + i] = math.sin(phase), math.cos(phase)
            k += 8
        x[k] = (positions[2] - row) / np.float32(10.0)
        x[k + 1] = (positions[3] - column) / np.float32(10.0)
        for i in range(num_hidden, seen.shape[1]):
            x[k + 2 + i - num_hidden] = seen[b, i]
    affine(inputs, model.inputs, False, hidden)
    for b in range(num_rows):
        for j in range(num_hidden):
            embeddings[b, index, num_latent + j] = hidden[b, j] + seen[b, j]
    predict(inputs, model.heads, model.num_bins, numbers, num_rows)
