"""The models of MMN and MMN-paper as kernels for the search on a CPU: a step, and the predictions after it.

A row's results do not depend on the other rows. They equal those of `spatial.MMNNetwork` and `paper.PaperNetwork` up to
rounding.

`B` is the number of roots, `N` of nodes of each, `C` of contexts, `M` the side of a context, `D` the size of a latent
state, `H` of the transition's hidden layer, `T` the number of features of a cell. An embedding is a latent state and
the transition's first layer without the action, `[D + H]`.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import torch
from torch.nn import functional

from ..common import kernels, lanes
from ..common.lanes import LANES, load, store
from .search import Root, SearchableModel
from .tree import ROOT, Settings, expand_and_backward, simulate

_ZERO = np.float32(0.0)
_ONE = np.float32(1.0)
_NORM_EPSILON = np.float32(1e-5)  # PyTorch's
_FREQUENCIES = (np.float32(0.25), np.float32(0.5), np.float32(1.0), np.float32(2.0))  # of `layers.waves`
_TURN = np.float32(2 * math.pi)
_SCALE_RATE = np.float32(5.0)  # of `network.Network`
_NEGLIGIBLE = np.float32(-20.0)  # logits so far below the highest have no weight in float32
_TREES_AT_ONCE = 32  # so that what they read of their contexts stays in the processor's cache
_ROWS_AT_ONCE = 4  # in a product, and
_PANEL = 2 * LANES  # columns, whose sums are then in registers


_kernel = functools.partial(kernels.compiled, fused=True)
_inlined = functools.partial(kernels.compiled, inline=True, fused=True)


class Linear(NamedTuple):
    """A linear layer."""

    weight: np.ndarray  # [inputs, outputs] float32
    bias: np.ndarray  # [outputs] float32


class Layer(NamedTuple):
    """A linear layer for `_affine`, in panels of 16 outputs; the last ones may be zeros."""

    weight: np.ndarray  # [panels, inputs, 16] float32
    bias: np.ndarray  # [16 panels] float32


class Heads(NamedTuple):
    """The layers of the heads."""

    body_1: Layer
    body_2: Layer
    heads: Layer


class Contexts(NamedTuple):
    """What is read of contexts; several neighbouring roots may belong to one."""

    positions: np.ndarray  # [C, 4], anchor and goal on the map, each (row, column)
    table: np.ndarray  # [C, M * M, H + T], of each cell: a row of the first layer's weights, features for the heads
    num_roots: int  # of each context


class MMNModel(NamedTuple):
    """What the kernels of MMN take; see `spatial.MMNNetwork`."""

    contexts: Contexts
    num_bins: int  # of categorical values
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


class PaperModel(NamedTuple):
    """What the kernels of MMN-paper take; see `paper.PaperNetwork`."""

    contexts: Contexts  # the table's first columns, for the first layer, may be lacking
    num_bins: int
    num_hidden: int
    scale: np.ndarray
    sharpness: np.ndarray
    periods: np.ndarray  # [7], of the waves of positions
    widths: np.ndarray  # [4], of the bells of distances
    weights: np.ndarray  # [C, W], those of the transition, in the order of `paper._weight_shapes`
    task: np.ndarray  # [C, Q], the heads' code of the context
    heads: Heads


class StandIn(NamedTuple):
    """What the kernels of the network take that `measure` compares with mctx's."""

    transition_1: np.ndarray  # [B, inputs and actions, D], of each root
    transition_2: np.ndarray  # [B, D, D]
    num_bins: int
    heads: Heads


class CompiledModel(SearchableModel):
    """A model for the search from some roots."""

    def __init__(self, model: Any, num_hidden: int, step: Callable[..., None], arrive: Callable[..., None]):
        """Takes the kernels `step`, not compiled yet, and `arrive`, their first argument, and H."""
        nodes, actions = np.zeros((1, 1, 1), np.float32), np.zeros(1, np.int64)
        self._step = kernels.first_class(step, (model, 0, nodes, actions, actions, 0, nodes[0]), fused=True)
        self._model, self._num_hidden, self._arrive = model, num_hidden, arrive

    def root(self, latent: torch.Tensor) -> Root:
        """Returns the root of a search from latent states `[B, D]`."""
        num_latent = latent.shape[-1]
        embedding = np.empty((len(latent), 1, num_latent + self._num_hidden), np.float32)
        embedding[:, 0, :num_latent] = latent.numpy()
        numbers = np.empty((len(latent), 9), np.float32)
        self._arrive(self._model, 0, embedding, 0, numbers)
        return Root(numbers[:, 3:], numbers[:, 2], torch.from_numpy(embedding[:, 0]))

    def search(
        self, tree: np.ndarray, gumbel: np.ndarray, visits: np.ndarray, settings: Settings, embedding: torch.Tensor
    ) -> None:
        """Runs all simulations."""
        _search(tree, gumbel, visits, settings, embedding.numpy(), self._step, self._model)


def linear_of(module: Any) -> Linear:
    """Returns the weights of a linear module."""
    return Linear(module.weight.detach().T.contiguous().numpy(), module.bias.detach().numpy())


def layer_of(weight: torch.Tensor, bias: torch.Tensor) -> Layer:
    """Returns a layer with weights `[outputs, inputs]` and biases `[outputs]`."""
    padding = -len(bias) % _PANEL
    panels = functional.pad(weight.detach(), (0, 0, 0, padding)).unflatten(0, (-1, _PANEL)).transpose(1, 2)
    return Layer(panels.contiguous().numpy(), functional.pad(bias.detach(), (0, padding)).numpy())


@_kernel
def _search(
    tree: np.ndarray,
    gumbel: np.ndarray,
    visits: np.ndarray,
    settings: Settings,
    embeddings: np.ndarray,
    step: Callable[..., None],
    model: Any,
) -> None:
    """Searches a few trees at a time."""
    num_nodes = tree.shape[1]
    actions, parents = np.empty(_TREES_AT_ONCE, np.int64), np.empty(_TREES_AT_ONCE, np.int64)
    numbers = np.empty((_TREES_AT_ONCE, 3 + gumbel.shape[1]), np.float32)
    states = np.empty((_TREES_AT_ONCE, num_nodes, embeddings.shape[1]), np.float32)
    for first in range(0, len(tree), _TREES_AT_ONCE):
        trees, noise = tree[first : first + _TREES_AT_ONCE], gumbel[first : first + _TREES_AT_ONCE]
        states[: len(trees), ROOT] = embeddings[first : first + _TREES_AT_ONCE]
        for index in range(1, num_nodes):
            simulate(trees, index, noise, visits[index - 1], settings, actions, parents)
            step(model, first, states[: len(trees)], parents, actions, index, numbers)
            expand_and_backward(trees, index, numbers)


# The kernels `step` are called for n neighbouring roots at a time. From the states `embeddings[:, parents]` of the
# roots from `first` on, they write those after `actions` into `embeddings[:, index]`, and the predictions into
# `numbers`, as `tree.expand_and_backward` takes them. `embeddings` is [n, N, D + H]; the other arrays may be longer.


def mmn_step(
    model: MMNModel,
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
    free, change = np.empty((num_rows, 6), np.float32), _scratch(num_rows, len(model.later_2.bias))
    hidden_1, hidden_2 = _scratch(num_rows, num_hidden), _scratch(num_rows, len(model.later_1.bias))
    for b in range(num_rows):
        before, a = embeddings[b, parents[b]], actions[b]
        _move_freely(before, model.free.weight, model.free.bias, model.free_by_action[a], free[b])
        _act(before, num_latent, free[b], model.ahead.weight, model.ahead.bias, model.actions[a], hidden_1[b])
        _rectify(hidden_1[b])
    _affine(hidden_1, model.later_1, True, hidden_2)
    _affine(hidden_2, model.later_2, False, change)
    for b in range(num_rows):
        before, after = embeddings[b, parents[b]], embeddings[b, index]
        _move(before, free[b], change[b], after)
        for j in range(7, num_latent):
            after[j] = before[j] + change[b, 3 + j]
        motion = after[7:num_latent]
        mean, factor = _moments(motion)
        for j in range(len(motion)):
            motion[j] = (motion[j] - mean) * factor * model.normalize.weight[0, j] + model.normalize.bias[j]
    mmn_arrive(model, first, embeddings, index, numbers)


@_kernel
def mmn_arrive(model: MMNModel, first: int, embeddings: np.ndarray, index: int, numbers: np.ndarray) -> None:
    """Writes the first layers of the latent states in `embeddings[:, index]` beside them, and the predictions."""
    contexts, num_rows = model.contexts, len(embeddings)
    num_hidden = len(model.ahead.bias)
    num_latent = embeddings.shape[2] - num_hidden
    read = np.empty((num_rows, contexts.table.shape[2]), np.float32)
    hidden = _scratch(num_rows, len(model.inputs.bias))
    inputs = _scratch(num_rows, model.heads.body_1.weight.shape[1])
    for b in range(num_rows):
        latent, x, c = embeddings[b, index], inputs[b], (first + b) // contexts.num_roots
        positions = contexts.positions[c]
        row, column = _place(model.scale, positions, latent)
        _read(row, column, contexts.table[c], model.sharpness[0], read[b])
        for i in range(num_latent - 2):
            x[i] = latent[2 + i]
        k = num_latent - 2
        for axis in range(2):
            for i in range(4):
                phase = _TURN * latent[axis] * _FREQUENCIES[i]
                x[k + i], x[k + 4 + i] = math.sin(phase), math.cos(phase)
            k += 8
        x[k] = (positions[2] - row) / np.float32(10.0)
        x[k + 1] = (positions[3] - column) / np.float32(10.0)
        for i in range(num_hidden, read.shape[1]):
            x[k + 2 + i - num_hidden] = read[b, i]
    _affine(inputs, model.inputs, False, hidden)
    for b in range(num_rows):
        for j in range(num_hidden):
            embeddings[b, index, num_latent + j] = hidden[b, j] + read[b, j]
    _predict(inputs, model.heads, model.num_bins, numbers, num_rows)


def paper_step(
    model: PaperModel,
    first: int,
    embeddings: np.ndarray,
    parents: np.ndarray,
    actions: np.ndarray,
    index: int,
    numbers: np.ndarray,
) -> None:
    """Takes a step in each tree."""
    num_hidden, num_changes = model.num_hidden, embeddings.shape[2] - model.num_hidden + 3
    num_latent = num_changes - 3
    free, hidden = np.empty(6, np.float32), np.empty(num_hidden, np.float32)
    change = np.empty(num_changes, np.float32)
    for b in range(len(embeddings)):
        before, after, a = embeddings[b, parents[b]], embeddings[b, index], actions[b]
        weights = model.weights[(first + b) // model.contexts.num_roots]
        bias, k = _matrix(weights, 0, 1, num_hidden)
        _, k = _matrix(weights, k, num_latent + 34, num_hidden)
        by_action, k = _matrix(weights, k, 6, num_hidden)
        ahead, k = _matrix(weights, k, 4, num_hidden)
        second, k = _matrix(weights, k, num_hidden, num_changes)
        second_bias, k = _matrix(weights, k, 1, num_changes)
        free_weight, k = _matrix(weights, k, 3, 6)
        free_bias, k = _matrix(weights, k, 1, 6)
        free_by_action, k = _matrix(weights, k, 6, 6)
        _move_freely(before, free_weight, free_bias[0], free_by_action[a], free)
        _act(before, num_latent, free, ahead, bias[0], by_action[a], hidden)
        _normalize(hidden)
        _rectify(hidden)
        change[:] = second_bias[0]
        _add_product(hidden, second, change)
        _move(before, free, change, after)
        for j in range(7, num_latent):
            after[j] = before[j] + change[3 + j]
        _normalize(after[7:num_latent])
    paper_arrive(model, first, embeddings, index, numbers)


@_kernel
def paper_arrive(model: PaperModel, first: int, embeddings: np.ndarray, index: int, numbers: np.ndarray) -> None:
    """Writes the first layers, without bias, of the latent states in `embeddings[:, index]`, and the predictions."""
    contexts, num_rows, num_hidden = model.contexts, len(embeddings), model.num_hidden
    num_latent, num_periods, num_widths = embeddings.shape[2] - num_hidden, len(model.periods), len(model.widths)
    num_inputs, num_codes = num_latent + 6 + 4 * num_periods, model.task.shape[1]
    num_features = model.heads.body_1.weight.shape[1] - num_inputs - 2 - num_widths - num_codes
    num_generated = contexts.table.shape[2] - num_features  # of a row of the table
    size = np.float32(math.sqrt(contexts.table.shape[1]))
    read = np.empty(contexts.table.shape[2], np.float32)
    inputs = _scratch(num_rows, model.heads.body_1.weight.shape[1])
    for b in range(num_rows):
        embedding, x, c = embeddings[b, index], inputs[b], (first + b) // contexts.num_roots
        positions = contexts.positions[c]
        row, column = _place(model.scale, positions, embedding)
        _read(row, column, contexts.table[c], model.sharpness[0], read)
        for i in range(num_latent - 2):
            x[i] = embedding[2 + i]
        k = num_latent - 2
        for axis in range(2):
            x[k + axis] = embedding[axis] / np.float32(5.0)
            place = row if axis == 0 else column
            x[k + 2 + axis] = (place - (size - _ONE) / np.float32(2.0)) * (np.float32(2.0) / size)
            for i in range(num_periods):
                phase = place * (_TURN / model.periods[i])
                wave = k + 8 + 2 * num_periods * axis + i
                x[wave], x[wave + num_periods] = math.sin(phase), math.cos(phase)
        for i in range(4):
            x[k + 4 + i] = (positions[i] - (size - _ONE) / np.float32(2.0)) * (np.float32(2.0) / size)
        layer = embedding[num_latent:]
        for j in range(num_hidden):
            layer[j] = read[j] if num_generated > 0 else _ZERO
        _add_product(x[:num_inputs], _matrix(model.weights[c], num_hidden, num_inputs, num_hidden)[0], layer)
        rows_away, columns_away = positions[2] - row, positions[3] - column
        k = num_inputs
        x[k], x[k + 1] = rows_away / np.float32(10.0), columns_away / np.float32(10.0)
        for i in range(num_widths):
            x[k + 2 + i] = math.exp(-(rows_away * rows_away + columns_away * columns_away) / model.widths[i])
        k += 2 + num_widths
        for i in range(num_codes):
            x[k + i] = model.task[c, i]
        for i in range(num_features):
            x[k + num_codes + i] = read[num_generated + i]
    _predict(inputs, model.heads, model.num_bins, numbers, num_rows)


def stand_in_step(
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
        _add_product(before, weights[:num_latent], hidden)
        _rectify(hidden)
        after[:] = before
        _add_product(hidden, model.transition_2[first + b], after)
        _normalize(after)
    stand_in_arrive(model, first, embeddings, index, numbers)


@_kernel
def stand_in_arrive(model: StandIn, first: int, embeddings: np.ndarray, index: int, numbers: np.ndarray) -> None:
    """Writes the predictions for the latent states in `embeddings[:, index]`."""
    inputs = _scratch(len(embeddings), embeddings.shape[2])
    inputs[: len(embeddings)] = embeddings[:, index]
    _predict(inputs, model.heads, model.num_bins, numbers, len(embeddings))


@_kernel
def _affine(x: np.ndarray, layer: Layer, rectified: bool, out: np.ndarray) -> None:
    """Writes a layer's outputs for rows in number a multiple of 4; a row's sums are in the same order everywhere.

    `x` `[rows, inputs or more]` and `out` `[rows, outputs, with padding]` are contiguous.
    """
    num_panels, num_inputs, _ = layer.weight.shape
    weights, outputs, width = layer.weight.reshape(-1), out.reshape(-1), out.shape[1]
    for panel in range(num_panels):
        column = panel * _PANEL
        for r in range(0, len(x), _ROWS_AT_ONCE):
            x_1, x_2, x_3, x_4 = x[r], x[r + 1], x[r + 2], x[r + 3]
            a_1 = a_2 = a_3 = a_4 = load(layer.bias, column)
            b_1 = b_2 = b_3 = b_4 = load(layer.bias, column + LANES)
            for k in range(num_inputs):
                begin = (panel * num_inputs + k) * _PANEL
                a, b = load(weights, begin), load(weights, begin + LANES)
                a_1, b_1 = lanes.add_product(x_1[k], a, a_1), lanes.add_product(x_1[k], b, b_1)
                a_2, b_2 = lanes.add_product(x_2[k], a, a_2), lanes.add_product(x_2[k], b, b_2)
                a_3, b_3 = lanes.add_product(x_3[k], a, a_3), lanes.add_product(x_3[k], b, b_3)
                a_4, b_4 = lanes.add_product(x_4[k], a, a_4), lanes.add_product(x_4[k], b, b_4)
            end = r * width + column
            for a, b in ((a_1, b_1), (a_2, b_2), (a_3, b_3), (a_4, b_4)):
                store(outputs, end, a)
                store(outputs, end + LANES, b)
                end += width
    if rectified:
        _rectify(outputs)


@_kernel
def _add_product(x: np.ndarray, weight: np.ndarray, out: np.ndarray) -> None:
    """Adds one row times weights `[inputs, outputs]`, all contiguous, to `out`."""
    num_inputs, num_outputs = len(x), len(out)
    weights = weight.reshape(-1)
    j = 0
    while j + 4 * LANES <= num_outputs:
        a, b, c, d = load(out, j), load(out, j + LANES), load(out, j + 2 * LANES), load(out, j + 3 * LANES)
        for k in range(num_inputs):
            i = k * num_outputs + j
            a = lanes.add_product(x[k], load(weights, i), a)
            b = lanes.add_product(x[k], load(weights, i + LANES), b)
            c = lanes.add_product(x[k], load(weights, i + 2 * LANES), c)
            d = lanes.add_product(x[k], load(weights, i + 3 * LANES), d)
        store(out, j, a)
        store(out, j + LANES, b)
        store(out, j + 2 * LANES, c)
        store(out, j + 3 * LANES, d)
        j += 4 * LANES
    while j + LANES <= num_outputs:
        a = load(out, j)
        for k in range(num_inputs):
            a = lanes.add_product(x[k], load(weights, k * num_outputs + j), a)
        store(out, j, a)
        j += LANES
    for k in range(num_inputs):
        for i in range(j, num_outputs):
            out[i] += x[k] * weight[k, i]


@_inlined
def _scratch(num_rows: int, num_columns: int) -> np.ndarray:
    """Returns an array of as many rows as `_affine` needs."""
    return np.zeros((num_rows + -num_rows % _ROWS_AT_ONCE, num_columns), np.float32)


@_inlined
def _matrix(weights: np.ndarray, begin: int, num_rows: int, num_columns: int) -> tuple[np.ndarray, int]:
    """Returns a matrix of flat weights, and where the next one begins."""
    end = begin + num_rows * num_columns
    return weights[begin:end].reshape((num_rows, num_columns)), end


@_inlined
def _rectify(values: np.ndarray) -> None:
    for j in range(len(values)):
        values[j] = max(_ZERO, values[j])


@_inlined
def _normalize(values: np.ndarray) -> None:
    """Brings the mean to 0 and the variance to 1."""
    mean, factor = _moments(values)
    for j in range(len(values)):
        values[j] = (values[j] - mean) * factor


@_inlined
def _moments(values: np.ndarray) -> tuple[np.float32, np.float32]:
    """Returns the mean, and the factor that brings the variance to 1."""
    count = np.float32(len(values))
    mean = variance = _ZERO
    for j in range(len(values)):
        mean += values[j] / count
    for j in range(len(values)):
        variance += (values[j] - mean) * (values[j] - mean) / count
    return mean, _ONE / np.float32(math.sqrt(variance + _NORM_EPSILON))


@_inlined
def _move_freely(
    latent: np.ndarray, weight: np.ndarray, bias: np.ndarray, by_action: np.ndarray, free: np.ndarray
) -> None:
    """Writes the change of the body in its own frame, were there no walls."""
    for j in range(6):
        total = bias[j] + by_action[j]
        for i in range(3):
            total += latent[4 + i] * weight[i, j]
        free[j] = total


@_inlined
def _act(
    embedding: np.ndarray,
    num_latent: int,
    free: np.ndarray,
    ahead: np.ndarray,
    bias: np.ndarray,
    by_action: np.ndarray,
    hidden: np.ndarray,
) -> None:
    """Writes the first layer with the action; see `network.ahead_of`."""
    move_x, move_y = _rotated(free[0], free[1], embedding[2], embedding[3])
    speed_x, speed_y = _rotated(free[3], free[4], embedding[2], embedding[3])
    for j in range(len(hidden)):
        total = embedding[num_latent + j] + bias[j] + by_action[j]
        total += move_x * ahead[0, j] + move_y * ahead[1, j] + speed_x * ahead[2, j] + speed_y * ahead[3, j]
        hidden[j] = total


@_inlined
def _place(scale: np.ndarray, positions: np.ndarray, latent: np.ndarray) -> tuple[np.float32, np.float32]:
    """Returns the estimated position (row, column)."""
    row = positions[0] + _SCALE_RATE * (latent[0] * scale[0, 0] + latent[1] * scale[1, 0])
    column = positions[1] + _SCALE_RATE * (latent[0] * scale[0, 1] + latent[1] * scale[1, 1])
    return row, column


@_kernel
def _read(row: np.float32, column: np.float32, table: np.ndarray, sharpness: np.float32, out: np.ndarray) -> None:
    """Writes a row of the table, interpolated as `reading.read` does."""
    size = round(math.sqrt(len(table)))
    near = np.empty((2, 4), np.float32)
    first = np.empty(2, np.int64)
    for axis in range(2):
        place = min(max(row if axis == 0 else column, _ZERO), np.float32(size - 1))
        first[axis] = math.floor(place) - 1
        total = _ZERO
        for i in range(4):
            cell = first[axis] + i
            distance = (place - np.float32(cell)) * (place - np.float32(cell))
            inside = 0 <= cell < size and distance < np.float32(4.0)
            near[axis, i] = math.exp(-sharpness * distance) if inside else _ZERO
            total += near[axis, i]
        for i in range(4):
            near[axis, i] /= total
    for j in range(len(out)):
        out[j] = _ZERO
    for i in range(4):
        for k in range(4):
            weight = near[0, i] * near[1, k]
            if weight > _ZERO:
                cell_row = table[(first[0] + i) * size + first[1] + k]
                for j in range(len(out)):
                    out[j] += weight * cell_row[j]


@_inlined
def _move(latent: np.ndarray, free: np.ndarray, change: np.ndarray, after: np.ndarray) -> None:
    """Writes the body after a step; see `network.moved_by`."""
    sine, cosine = latent[2], latent[3]
    x, y = _rotated(free[0] + change[0], free[1] + change[1], sine, cosine)
    after[0] = latent[0] + x + change[6]
    after[1] = latent[1] + y + change[7]
    turn = free[2] + change[2]
    after[3], after[2] = _rotated(cosine, sine, math.sin(turn), math.cos(turn))
    forward, left = _rotated(change[8], change[9], -sine, cosine)
    after[4] = free[3] + change[3] + forward
    after[5] = free[4] + change[4] + left
    after[6] = free[5] + change[5]


@_inlined
def _rotated(x: np.float32, y: np.float32, sine: np.float32, cosine: np.float32) -> tuple[np.float32, np.float32]:
    return cosine * x - sine * y, sine * x + cosine * y


@_inlined
def _predict(inputs: np.ndarray, heads: Heads, num_bins: int, numbers: np.ndarray, num_rows: int) -> None:
    """Writes the predictions for the heads' inputs."""
    hidden_1 = np.empty((len(inputs), len(heads.body_1.bias)), np.float32)
    hidden_2 = np.empty((len(inputs), len(heads.body_2.bias)), np.float32)
    outputs = np.empty((len(inputs), len(heads.heads.bias)), np.float32)
    _affine(inputs, heads.body_1, True, hidden_1)
    _affine(hidden_1, heads.body_2, True, hidden_2)
    _affine(hidden_2, heads.heads, False, outputs)
    for b in range(num_rows):
        _conclude(outputs[b], num_bins, numbers[b])


@_inlined
def _conclude(outputs: np.ndarray, num_bins: int, numbers: np.ndarray) -> None:
    """Writes reward, discount, value and logits of the policy, given the heads' outputs."""
    logits = outputs[6 : 6 + num_bins]
    highest = logits[0]
    for j in range(1, num_bins):
        highest = max(highest, logits[j])
    total = weighted = _ZERO
    for j in range(num_bins):
        logit = logits[j] - highest
        if logit > _NEGLIGIBLE:
            weight = np.float32(math.exp(logit))
            total += weight
            weighted += weight * np.float32(j + 1 - num_bins)
    discount = _ONE / (_ONE + np.float32(math.exp(outputs[6 + num_bins])))
    numbers[0], numbers[1], numbers[2] = -discount, discount, weighted / total
    for j in range(6):
        numbers[3 + j] = outputs[j]
