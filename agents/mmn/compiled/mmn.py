"""The model of MMN as kernels; they equal `network.MMNNetwork` up to rounding."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .parts import (
    ONE,
    TURN,
    ZERO,
    Contexts,
    Heads,
    act,
    add_product,
    kernel,
    locate,
    move,
    move_freely,
    normalize,
    predict,
    read,
    rectify,
    scratch,
)


class Generated(NamedTuple):
    """The transition's weights of each context; see `network.MMNNetwork`."""

    bias: np.ndarray  # [C, 1, H]
    inputs: np.ndarray  # [C, inputs, H]
    actions: np.ndarray  # [C, 6, H]
    ahead: np.ndarray  # [C, 4, H]
    second: np.ndarray  # [C, H, 10 + D - 7]
    second_bias: np.ndarray  # [C, 1, 10 + D - 7]
    free: np.ndarray  # [C, 3, 6]
    free_bias: np.ndarray  # [C, 1, 6]
    free_actions: np.ndarray  # [C, 6, 6]


class MMNModel(NamedTuple):
    """What the kernels of MMN take; see `network.MMNNetwork`."""

    contexts: Contexts  # the table's first columns, for the first layer, may be lacking
    num_bins: int
    scale: np.ndarray
    sharpness: np.ndarray
    periods: np.ndarray  # [7], of the waves of positions
    widths: np.ndarray  # [4], of the bells of distances
    generated: Generated
    task: np.ndarray  # [C, Q], the heads' code of the context
    heads: Heads


def step(
    model: MMNModel,
    first: int,
    embeddings: np.ndarray,
    parents: np.ndarray,
    actions: np.ndarray,
    index: int,
    numbers: np.ndarray,
) -> None:
    """Takes a step in each tree."""
    weights = model.generated
    num_hidden, num_changes = weights.second.shape[1:]
    num_latent = num_changes - 3
    free, hidden = np.empty(6, np.float32), np.empty(num_hidden, np.float32)
    change = np.empty(num_changes, np.float32)
    for b in range(len(embeddings)):
        before, after, a = embeddings[b, parents[b]], embeddings[b, index], actions[b]
        c = (first + b) // model.contexts.num_roots
        move_freely(before, weights.free[c], weights.free_bias[c, 0], weights.free_actions[c, a], free)
        act(before, num_latent, free, weights.ahead[c], weights.bias[c, 0], weights.actions[c, a], hidden)
        normalize(hidden)
        rectify(hidden)
        change[:] = weights.second_bias[c, 0]
        add_product(hidden, weights.second[c], change)
        move(before, free, change, after)
        for j in range(7, num_latent):
            after[j] = before[j] + change[3 + j]
        normalize(after[7:num_latent])
    arrive(model, first, embeddings, index, numbers)


@kernel
def arrive(model: MMNModel, first: int, embeddings: np.ndarray, index: int, numbers: np.ndarray) -> None:
    """Writes the first layers, without bias, of the latent states in `embeddings[:, index]`, and the predictions."""
    contexts, num_rows = model.contexts, len(embeddings)
    num_inputs, num_hidden = model.generated.inputs.shape[1:]
    num_latent, num_periods, num_widths = embeddings.shape[2] - num_hidden, len(model.periods), len(model.widths)
    num_codes = model.task.shape[1]
    num_features = model.heads.body_1.weight.shape[1] - num_inputs - 2 - num_widths - num_codes
    num_generated = contexts.table.shape[2] - num_features  # of a row of the table
    size = np.float32(math.sqrt(contexts.table.shape[1]))
    seen = np.empty(contexts.table.shape[2], np.float32)
    inputs = scratch(num_rows, model.heads.body_1.weight.shape[1])
    for b in range(num_rows):
        embedding, x, c = embeddings[b, index], inputs[b], (first + b) // contexts.num_roots
        positions = contexts.positions[c]
        row, column = locate(model.scale, positions, embedding)
        read(row, column, contexts.table[c], model.sharpness[0], seen)
        for i in range(num_latent - 2):
            x[i] = embedding[2 + i]
        k = num_latent - 2
        for axis in range(2):
            x[k + axis] = embedding[axis] / np.float32(5.0)
            place = row if axis == 0 else column
            x[k + 2 + axis] = (place - (size - ONE) / np.float32(2.0)) * (np.float32(2.0) / size)
            for i in range(num_periods):
                phase = place * (TURN / model.periods[i])
                wave = k + 8 + 2 * num_periods * axis + i
                x[wave], x[wave + num_periods] = math.sin(phase), math.cos(phase)
        for i in range(4):
            x[k + 4 + i] = (positions[i] - (size - ONE) / np.float32(2.0)) * (np.float32(2.0) / size)
        layer = embedding[num_latent:]
        for j in range(num_hidden):
            layer[j] = seen[j] if num_generated > 0 else ZERO
        add_product(x[:num_inputs], model.generated.inputs[c], layer)
        rows_away, columns_away = positions[2] - row, positions[3] - column
        k = num_inputs
        x[k], x[k + 1] = rows_away / np.float32(10.0), columns_away / np.float32(10.0)
        for i in range(num_widths):
            x[k + 2 + i] = math.exp(-(rows_away * rows_away + columns_away * columns_away) / model.widths[i])
        k += 2 + num_widths
        for i in range(num_codes):
            x[k + i] = model.task[c, i]
        for i in range(num_features):
            x[k + num_codes + i] = seen[num_generated + i]
    predict(inputs, model.heads, model.num_bins, numbers, num_rows)
