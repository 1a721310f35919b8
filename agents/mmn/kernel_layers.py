"""Layers of networks as kernels, for a few rows at a time on a CPU; they equal PyTorch's up to rounding.

A row's result depends neither on the other rows nor on their number: every sum adds its terms in the same order.

`R` is the number of rows.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np
from torch import nn

from mazebench import kernels

ZERO = np.float32(0.0)
ONE = np.float32(1.0)
_NORM_EPSILON = np.float32(1e-5)  # of PyTorch's layer norm

kernel = functools.partial(kernels.compiled, fused=True)
inlined = functools.partial(kernels.compiled, inline=True, fused=True)


class Linear(NamedTuple):
    """The weights of a linear layer."""

    weight: np.ndarray  # [inputs, outputs] float32
    bias: np.ndarray  # [outputs] float32


def linear_of(layer: nn.Module) -> Linear:
    """Returns a copy of the weights of an `nn.Linear`."""
    weight, bias = (parameter.detach().numpy() for parameter in layer.parameters())
    return Linear(weight.T.copy(), bias.copy())


@inlined
def copy_to(values: np.ndarray, out: np.ndarray) -> None:
    """Copies `values` `[n]` into `out` `[n]`; numba takes half a second to compile an assignment of arrays."""
    for j in range(len(out)):
        out[j] = values[j]


@kernel
def linear(x: np.ndarray, layer: Linear, out: np.ndarray) -> None:
    """Writes the outputs `[R, outputs]` of a layer for `x` `[R, inputs]`."""
    for r in range(len(x)):
        copy_to(layer.bias, out[r])
    add_product(x, layer.weight, out)


@kernel
def add_product(x: np.ndarray, weight: np.ndarray, out: np.ndarray) -> None:
    """Adds `x` `[R, inputs]` times `weight` `[inputs, outputs]` to `out` `[R, outputs]`.

    Eight inputs at a time are added for all rows, so that `out` is seldom loaded and stored, and the weights stay in
    the processor's nearest cache from row to row.
    """
    num_inputs, num_outputs = weight.shape
    num_in_eights = num_inputs - num_inputs % 8
    for k in range(0, num_in_eights, 8):
        for r in range(len(x)):
            x_0, x_1, x_2, x_3 = x[r, k], x[r, k + 1], x[r, k + 2], x[r, k + 3]
            x_4, x_5, x_6, x_7 = x[r, k + 4], x[r, k + 5], x[r, k + 6], x[r, k + 7]
            for j in range(num_outputs):
                total = out[r, j] + x_0 * weight[k, j] + x_1 * weight[k + 1, j]
                total = total + x_2 * weight[k + 2, j] + x_3 * weight[k + 3, j]
                total = total + x_4 * weight[k + 4, j] + x_5 * weight[k + 5, j]
                out[r, j] = total + x_6 * weight[k + 6, j] + x_7 * weight[k + 7, j]
    for k in range(num_in_eights, num_inputs):
        for r in range(len(x)):
            x_0 = x[r, k]
            for j in range(num_outputs):
                out[r, j] += x_0 * weight[k, j]


@inlined
def rectify(values: np.ndarray) -> None:
    """Replaces negative numbers of `values` `[n]` by 0."""
    for j in range(len(values)):
        values[j] = max(ZERO, values[j])


@inlined
def normalize(values: np.ndarray) -> None:
    """Brings the mean of `values` `[n]` to 0 and their variance to 1."""
    count = np.float32(len(values))
    mean = variance = ZERO
    for j in range(len(values)):
        mean += values[j] / count
    for j in range(len(values)):
        variance += (values[j] - mean) * (values[j] - mean) / count
    factor = ONE / np.float32(math.sqrt(variance + _NORM_EPSILON))
    for j in range(len(values)):
        values[j] = (values[j] - mean) * factor
