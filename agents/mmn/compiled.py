"""MMN's model as kernels for the search on a CPU: a step and its predictions, for one latent state in each context.

A row's results do not depend on the other rows. They equal those of `spatial.MMNNetwork` up to rounding.

`B` is the number of contexts, `M` the side of the context, `D` the size of a latent state, `H` of the transition's
hidden layer, `T` the number of features of a cell.
"""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import numpy as np
import torch

from ..common import kernels
from .search import Evaluation, Root

_ZERO = np.float32(0.0)
_ONE = np.float32(1.0)
_NORM_EPSILON = np.float32(1e-5)  # PyTorch's
_FREQUENCIES = (np.float32(0.25), np.float32(0.5), np.float32(1.0), np.float32(2.0))  # of `layers.waves`
_TURN = np.float32(2 * math.pi)
_SCALE_RATE = np.float32(5.0)  # of `network.Network`
_NEGLIGIBLE = np.float32(-20.0)  # logits so far below the highest have no weight in float32
_LANES = 8  # columns of weights are padded to a multiple of it, which speeds up their loops


_compiled = functools.partial(kernels.compiled, fused=True)
_inlined = functools.partial(kernels.compiled, inline=True, fused=True)


class Layer(NamedTuple):
    """A linear layer."""

    weight: np.ndarray  # [inputs, outputs] float32
    bias: np.ndarray  # [outputs] float32


class Weights(NamedTuple):
    """The network's weights; see `spatial.MMNNetwork`."""

    scale: np.ndarray
    sharpness: np.ndarray  # [1], after softplus
    free: Layer
    free_by_action: np.ndarray
    ahead: Layer
    inputs: Layer
    actions: np.ndarray
    later_1: Layer
    later_2: Layer
    normalize: Layer  # weight [1, D - 7]
    body_1: Layer
    body_2: Layer
    heads: Layer


class Scratch(NamedTuple):
    """Arrays that the kernels write to."""

    hidden_1: np.ndarray  # [B, H]
    hidden_2: np.ndarray  # [B, H]
    change: np.ndarray  # [B, 10 + D - 7 and padding]
    read: np.ndarray  # [B, H + T]
    inputs: np.ndarray  # [B, inputs of the heads]
    body_1: np.ndarray  # [B, hidden units of the heads]
    body_2: np.ndarray  # likewise
    outputs: np.ndarray  # [B, outputs of the heads and padding]


class CompiledModel:
    """The model of B contexts, as the search needs it."""

    def __init__(self, weights: Weights, num_bins: int, positions: torch.Tensor, table: torch.Tensor):
        """Takes anchors and goals `[B, 4]`, and tables `[B, M * M, H + T]`."""
        self._weights, self._num_bins = weights, num_bins
        self._positions, self._table = (np.ascontiguousarray(part.numpy()) for part in (positions, table))
        hidden, units = len(weights.ahead.bias), len(weights.body_1.bias)
        sizes = [hidden, hidden, len(weights.later_2.bias), table.shape[-1], len(weights.body_1.weight), units, units]
        sizes.append(len(weights.heads.bias))
        self._scratch = Scratch(*(np.empty((len(positions), size), np.float32) for size in sizes))

    def root(self, latent: torch.Tensor) -> Root:
        """Returns the root of a search from latent states `[B, 1, D]`."""
        after = np.empty((len(latent), latent.shape[-1] + self._scratch.hidden_1.shape[1]), np.float32)
        after[:, : latent.shape[-1]] = latent[:, 0].numpy()
        numbers = self._arrive(after)
        return Root(numbers[:, 3:], numbers[:, 2], torch.from_numpy(after))

    def step(self, embedding: torch.Tensor, action: np.ndarray) -> Evaluation:
        """Returns the predictions for a step, and the embeddings `[B, D + H]` after it."""
        after = np.empty(embedding.shape, np.float32)
        step(self._weights, self._scratch, embedding.numpy(), action, after)
        numbers = self._arrive(after)
        return Evaluation(numbers[:, 0], numbers[:, 1], numbers[:, 3:], numbers[:, 2], torch.from_numpy(after))

    def _arrive(self, after: np.ndarray) -> np.ndarray:
        numbers = np.empty((len(after), 9), np.float32)
        arrive(self._weights, self._scratch, self._positions, self._table, self._num_bins, after, numbers)
        return numbers


def layer_of(module: Any) -> Layer:
    """Returns the weights of a linear module, with columns of zeros up to a multiple of 8."""
    weight, bias = (parameter.detach().numpy().T for parameter in (module.weight, module.bias))
    padding = -len(bias) % _LANES
    return Layer(np.ascontiguousarray(np.pad(weight, ((0, 0), (0, padding)))), np.pad(bias, (0, padding)))


@_compiled
def step(weights: Weights, scratch: Scratch, embedding: np.ndarray, action: np.ndarray, after: np.ndarray) -> None:
    """Writes the next latent states into the first D columns of `after` `[B, D + H]`; `embedding` is like it."""
    num_latent = after.shape[1] - scratch.hidden_1.shape[1]
    free = np.empty((len(after), 6), np.float32)
    for b in range(len(after)):
        latent, a = embedding[b], action[b]
        for j in range(6):
            total = weights.free.bias[j] + weights.free_by_action[a, j]
            for i in range(3):
                total += latent[4 + i] * weights.free.weight[i, j]
            free[b, j] = total
        move_x, move_y = _rotated(free[b, 0], free[b, 1], latent[2], latent[3])
        speed_x, speed_y = _rotated(free[b, 3], free[b, 4], latent[2], latent[3])
        ahead, hidden = weights.ahead.weight, scratch.hidden_1[b]
        for j in range(len(hidden)):
            total = latent[num_latent + j] + weights.ahead.bias[j] + weights.actions[a, j]
            total += move_x * ahead[0, j] + move_y * ahead[1, j] + speed_x * ahead[2, j] + speed_y * ahead[3, j]
            hidden[j] = max(_ZERO, total)
    _affine(scratch.hidden_1, weights.later_1, True, scratch.hidden_2)
    _affine(scratch.hidden_2, weights.later_2, False, scratch.change)
    for b in range(len(after)):
        _move(embedding[b], free[b], scratch.change[b], after[b])
        _normalize(embedding[b], scratch.change[b], weights.normalize, after[b], num_latent)


@_compiled
def arrive(
    weights: Weights,
    scratch: Scratch,
    positions: np.ndarray,
    table: np.ndarray,
    num_bins: int,
    after: np.ndarray,
    numbers: np.ndarray,
) -> None:
    """Writes the first layers of the latent states in `after` `[B, D + H]` beside them, and predictions.

    Args:
      weights, scratch: the network's.
      positions: `[B, 4]`, anchor and goal on the map, each (row, column).
      table: `[B, M * M, H + T]`, of each cell.
      num_bins: of categorical values.
      after: `[B, D + H]`.
      numbers: `[B, 9]`, output: reward, discount, value, logits of the policy.
    """
    num_hidden = scratch.hidden_1.shape[1]
    num_latent = after.shape[1] - num_hidden
    num_inputs = len(weights.inputs.weight)
    for b in range(len(after)):
        latent, inputs = after[b], scratch.inputs[b]
        row, column = _place(weights.scale, positions[b], latent)
        _read(row, column, table[b], weights.sharpness[0], scratch.read[b])
        for i in range(num_latent - 2):
            inputs[i] = latent[2 + i]
        k = num_latent - 2
        for axis in range(2):
            for i in range(4):
                phase = _TURN * latent[axis] * _FREQUENCIES[i]
                inputs[k + i], inputs[k + 4 + i] = math.sin(phase), math.cos(phase)
            k += 8
        inputs[k] = (positions[b, 2] - row) / np.float32(10.0)
        inputs[k + 1] = (positions[b, 3] - column) / np.float32(10.0)
        for i in range(num_hidden, scratch.read.shape[1]):
            inputs[k + 2 + i - num_hidden] = scratch.read[b, i]
    _affine(scratch.inputs[:, :num_inputs], weights.inputs, False, scratch.hidden_1)
    for b in range(len(after)):
        for j in range(num_hidden):
            after[b, num_latent + j] = scratch.hidden_1[b, j] + scratch.read[b, j]
    _affine(scratch.inputs, weights.body_1, True, scratch.body_1)
    _affine(scratch.body_1, weights.body_2, True, scratch.body_2)
    _affine(scratch.body_2, weights.heads, False, scratch.outputs)
    for b in range(len(after)):
        _conclude(scratch.outputs[b], num_bins, numbers[b])


@_compiled
def _affine(x: np.ndarray, layer: Layer, rectified: bool, out: np.ndarray) -> None:
    """Writes a layer's outputs; a row's additions are in the same order, wherever the row stands."""
    weight, bias = layer
    num_rows, num_inputs = x.shape
    for r in range(0, num_rows, 2):
        second = min(r + 1, num_rows - 1)
        x_1, x_2, out_1, out_2 = x[r], x[second], out[r], out[second]
        for j in range(len(bias)):
            out_1[j] = out_2[j] = bias[j]
        k = 0
        while k + 4 <= num_inputs:
            w_1, w_2, w_3, w_4 = weight[k], weight[k + 1], weight[k + 2], weight[k + 3]
            a_1, a_2, a_3, a_4 = x_1[k], x_1[k + 1], x_1[k + 2], x_1[k + 3]
            b_1, b_2, b_3, b_4 = x_2[k], x_2[k + 1], x_2[k + 2], x_2[k + 3]
            for j in range(len(bias)):
                value_1 = (((out_1[j] + a_1 * w_1[j]) + a_2 * w_2[j]) + a_3 * w_3[j]) + a_4 * w_4[j]
                value_2 = (((out_2[j] + b_1 * w_1[j]) + b_2 * w_2[j]) + b_3 * w_3[j]) + b_4 * w_4[j]
                out_1[j], out_2[j] = value_1, value_2
            k += 4
        while k < num_inputs:
            for j in range(len(bias)):
                value_1, value_2 = out_1[j] + x_1[k] * weight[k, j], out_2[j] + x_2[k] * weight[k, j]
                out_1[j], out_2[j] = value_1, value_2
            k += 1
        if rectified:
            for j in range(len(bias)):
                value_1, value_2 = max(_ZERO, out_1[j]), max(_ZERO, out_2[j])
                out_1[j], out_2[j] = value_1, value_2


@_inlined
def _place(scale: np.ndarray, positions: np.ndarray, latent: np.ndarray) -> tuple[np.float32, np.float32]:
    """Returns the estimated position (row, column)."""
    row = positions[0] + _SCALE_RATE * (latent[0] * scale[0, 0] + latent[1] * scale[1, 0])
    column = positions[1] + _SCALE_RATE * (latent[0] * scale[0, 1] + latent[1] * scale[1, 1])
    return row, column


@_compiled
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
def _normalize(latent: np.ndarray, change: np.ndarray, layer: Layer, after: np.ndarray, num_latent: int) -> None:
    """Writes the code of the motion after a step."""
    count = np.float32(num_latent - 7)
    mean = variance = _ZERO
    for j in range(7, num_latent):
        after[j] = latent[j] + change[3 + j]
        mean += after[j] / count
    for j in range(7, num_latent):
        variance += (after[j] - mean) * (after[j] - mean) / count
    factor = _ONE / np.float32(math.sqrt(variance + _NORM_EPSILON))
    for j in range(7, num_latent):
        after[j] = (after[j] - mean) * factor * layer.weight[0, j - 7] + layer.bias[j - 7]


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
