"""The parts of MMN's model as kernels: layers, motion, reading of the map, predictions.

A row's results do not depend on the other rows.

`C` is the number of contexts, `M` the side of a context, `D` the size of a latent state, `H` of the transition's hidden
layer, `T` the number of features of a cell. An embedding is a latent state and the transition's first layer without the
action, `[D + H]`.
"""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import numpy as np
import torch
from torch.nn import functional

from ...common import kernels
from ...common.lanes import LANES, add_scaled, load, store

ZERO = np.float32(0.0)
ONE = np.float32(1.0)
TURN = np.float32(2 * math.pi)
_NORM_EPSILON = np.float32(1e-5)  # PyTorch's
_SCALE_RATE = np.float32(5.0)  # of `muzero.network.Network`
_NEGLIGIBLE = np.float32(-20.0)  # logits so far below the highest have no weight in float32
_ROWS_AT_ONCE = 4  # in a product, and
_PANEL = 2 * LANES  # columns, whose sums are then in registers

kernel = functools.partial(kernels.compiled, fused=True)
inlined = functools.partial(kernels.compiled, inline=True, fused=True)


class Layer(NamedTuple):
    """A linear layer for `affine`, in panels of 16 outputs; the last ones may be zeros."""

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


def layer_of(weight: torch.Tensor, bias: torch.Tensor) -> Layer:
    """Returns a layer with weights `[outputs, inputs]` and biases `[outputs]`."""
    padding = -len(bias) % _PANEL
    panels = functional.pad(weight.detach(), (0, 0, 0, padding)).unflatten(0, (-1, _PANEL)).transpose(1, 2)
    return Layer(panels.contiguous().numpy(), functional.pad(bias.detach(), (0, padding)).numpy())


def heads_of(body: Any, heads: Any) -> Heads:
    """Returns the layers of a network's `body` and `heads`."""
    return Heads(*(layer_of(module.weight, module.bias) for module in (body[0], body[2], heads)))


@kernel
def affine(x: np.ndarray, layer: Layer, rectified: bool, out: np.ndarray) -> None:
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
                a_1, b_1 = add_scaled(x_1[k], a, a_1), add_scaled(x_1[k], b, b_1)
                a_2, b_2 = add_scaled(x_2[k], a, a_2), add_scaled(x_2[k], b, b_2)
                a_3, b_3 = add_scaled(x_3[k], a, a_3), add_scaled(x_3[k], b, b_3)
                a_4, b_4 = add_scaled(x_4[k], a, a_4), add_scaled(x_4[k], b, b_4)
            end = r * width + column
            for a, b in ((a_1, b_1), (a_2, b_2), (a_3, b_3), (a_4, b_4)):
                store(outputs, end, a)
                store(outputs, end + LANES, b)
                end += width
    if rectified:
        rectify(outputs)


@kernel
def add_product(x: np.ndarray, weight: np.ndarray, out: np.ndarray) -> None:
    """Adds one row times weights `[inputs, outputs]`, all contiguous, to `out`."""
    num_inputs, num_outputs = len(x), len(out)
    weights = weight.reshape(-1)
    j = 0
    while j + 4 * LANES <= num_outputs:
        a, b, c, d = load(out, j), load(out, j + LANES), load(out, j + 2 * LANES), load(out, j + 3 * LANES)
        for k in range(num_inputs):
            i = k * num_outputs + j
            a = add_scaled(x[k], load(weights, i), a)
            b = add_scaled(x[k], load(weights, i + LANES), b)
            c = add_scaled(x[k], load(weights, i + 2 * LANES), c)
            d = add_scaled(x[k], load(weights, i + 3 * LANES), d)
        store(out, j, a)
        store(out, j + LANES, b)
        store(out, j + 2 * LANES, c)
        store(out, j + 3 * LANES, d)
        j += 4 * LANES
    while j + LANES <= num_outputs:
        a = load(out, j)
        for k in range(num_inputs):
            a = add_scaled(x[k], load(weights, k * num_outputs + j), a)
        store(out, j, a)
        j += LANES
    for k in range(num_inputs):
        for i in range(j, num_outputs):
            out[i] += x[k] * weight[k, i]


@inlined
def scratch(num_rows: int, num_columns: int) -> np.ndarray:
    """Returns an array of as many rows as `affine` needs."""
    return np.zeros((num_rows + -num_rows % _ROWS_AT_ONCE, num_columns), np.float32)


@inlined
def rectify(values: np.ndarray) -> None:
    """Replaces negative numbers by 0."""
    for j in range(len(values)):
        values[j] = max(ZERO, values[j])


@inlined
def normalize(values: np.ndarray) -> None:
    """Brings the mean to 0 and the variance to 1."""
    mean, factor = moments(values)
    for j in range(len(values)):
        values[j] = (values[j] - mean) * factor


@inlined
def moments(values: np.ndarray) -> tuple[np.float32, np.float32]:
    """Returns the mean, and the factor that brings the variance to 1."""
    count = np.float32(len(values))
    mean = variance = ZERO
    for j in range(len(values)):
        mean += values[j] / count
    for j in range(len(values)):
        variance += (values[j] - mean) * (values[j] - mean) / count
    return mean, ONE / np.float32(math.sqrt(variance + _NORM_EPSILON))


@inlined
def move_freely(
    latent: np.ndarray, weight: np.ndarray, bias: np.ndarray, by_action: np.ndarray, free: np.ndarray
) -> None:
    """Writes the change of the body in its own frame, were there no walls."""
    for j in range(6):
        total = bias[j] + by_action[j]
        for i in range(3):
            total += latent[4 + i] * weight[i, j]
        free[j] = total


@inlined
def act(
    embedding: np.ndarray,
    num_latent: int,
    free: np.ndarray,
    ahead: np.ndarray,
    bias: np.ndarray,
    by_action: np.ndarray,
    hidden: np.ndarray,
) -> None:
    """Writes the first layer with the action; see `muzero.network.ahead_of`."""
    move_x, move_y = rotated(free[0], free[1], embedding[2], embedding[3])
    speed_x, speed_y = rotated(free[3], free[4], embedding[2], embedding[3])
    for j in range(len(hidden)):
        total = embedding[num_latent + j] + bias[j] + by_action[j]
        total += move_x * ahead[0, j] + move_y * ahead[1, j] + speed_x * ahead[2, j] + speed_y * ahead[3, j]
        hidden[j] = total


@inlined
def locate(scale: np.ndarray, positions: np.ndarray, latent: np.ndarray) -> tuple[np.float32, np.float32]:
    """Returns the estimated position (row, column)."""
    row = positions[0] + _SCALE_RATE * (latent[0] * scale[0, 0] + latent[1] * scale[1, 0])
    column = positions[1] + _SCALE_RATE * (latent[0] * scale[0, 1] + latent[1] * scale[1, 1])
    return row, column


@kernel
def read(row: np.float32, column: np.float32, table: np.ndarray, sharpness: np.float32, out: np.ndarray) -> None:
    """Writes a row of the table, interpolated as `muzero.reading.read` does."""
    size = round(math.sqrt(len(table)))
    near = np.empty((2, 4), np.float32)
    first = np.empty(2, np.int64)
    for axis in range(2):
        place = min(max(row if axis == 0 else column, ZERO), np.float32(size - 1))
        first[axis] = math.floor(place) - 1
        total = ZERO
        for i in range(4):
            cell = first[axis] + i
            distance = (place - np.float32(cell)) * (place - np.float32(cell))
            inside = 0 <= cell < size and distance < np.float32(4.0)
            near[axis, i] = math.exp(-sharpness * distance) if inside else ZERO
            total += near[axis, i]
        for i in range(4):
            near[axis, i] /= total
    for j in range(len(out)):
        out[j] = ZERO
    for i in range(4):
        for k in range(4):
            weight = near[0, i] * near[1, k]
            if weight > ZERO:
                cell_row = table[(first[0] + i) * size + first[1] + k]
                for j in range(len(out)):
                    out[j] += weight * cell_row[j]


@inlined
def move(latent: np.ndarray, free: np.ndarray, change: np.ndarray, after: np.ndarray) -> None:
    """Writes the body after a step; see `muzero.network.moved_by`."""
    sine, cosine = latent[2], latent[3]
    x, y = rotated(free[0] + change[0], free[1] + change[1], sine, cosine)
    after[0] = latent[0] + x + change[6]
    after[1] = latent[1] + y + change[7]
    turn = free[2] + change[2]
    after[3], after[2] = rotated(cosine, sine, math.sin(turn), math.cos(turn))
    forward, left = rotated(change[8], change[9], -sine, cosine)
    after[4] = free[3] + change[3] + forward
    after[5] = free[4] + change[4] + left
    after[6] = free[5] + change[5]


@inlined
def rotated(x: np.float32, y: np.float32, sine: np.float32, cosine: np.float32) -> tuple[np.float32, np.float32]:
    """Returns a vector, turned by an angle."""
    return cosine * x - sine * y, sine * x + cosine * y


@inlined
def predict(inputs: np.ndarray, heads: Heads, num_bins: int, numbers: np.ndarray, num_rows: int) -> None:
    """Writes the predictions for the heads' inputs."""
    hidden_1 = np.empty((len(inputs), len(heads.body_1.bias)), np.float32)
    hidden_2 = np.empty((len(inputs), len(heads.body_2.bias)), np.float32)
    outputs = np.empty((len(inputs), len(heads.heads.bias)), np.float32)
    affine(inputs, heads.body_1, True, hidden_1)
    affine(hidden_1, heads.body_2, True, hidden_2)
    affine(hidden_2, heads.heads, False, outputs)
    for b in range(num_rows):
        conclude(outputs[b], num_bins, numbers[b])


@inlined
def conclude(outputs: np.ndarray, num_bins: int, numbers: np.ndarray) -> None:
    """Writes reward, discount, value and logits of the policy, given the heads' outputs."""
    logits = outputs[6 : 6 + num_bins]
    highest = logits[0]
    for j in range(1, num_bins):
        highest = max(highest, logits[j])
    total = weighted = ZERO
    for j in range(num_bins):
        logit = logits[j] - highest
        if logit > _NEGLIGIBLE:
            weight = np.float32(math.exp(logit))
            total += weight
            weighted += weight * np.float32(j + 1 - num_bins)
    discount = ONE / (ONE + np.float32(math.exp(outputs[6 + num_bins])))
    numbers[0], numbers[1], numbers[2] = -discount, discount, weighted / total
    for j in range(6):
        numbers[3 + j] = outputs[j]
