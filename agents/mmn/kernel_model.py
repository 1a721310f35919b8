"""The model of MMN as kernels, for searches on a CPU; it equals `hypermodel.MMNNetwork` up to rounding.

`C` is the number of contexts, `n` of neighbouring roots, `N` of nodes of a tree, `M` the side of a context, `D` the
size of a latent state, `H` of the transition's hidden layer. A state is a latent state and the transition's first layer
without bias and action, `[D + H]`.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
import torch

from mazebench.constants import NUM_ACTIONS

from ..common.layers import DISPLACEMENT_UNIT, NUM_PLACE, NUM_TO_GOAL, PERIODS, SCALE_RATE, WAY_UNIT, WIDTHS, steepness
from ..muzero.search import KernelModel, Root, run_simulations
from ..muzero.tree import ROOT, Evaluation, Settings, empty_evaluation
from .hypermodel import NUM_BODY, NUM_CHANGES, NUM_FREE, NUM_POSE, Code, MMNNetwork
from .kernel_layers import (
    ONE,
    ZERO,
    Linear,
    add_product,
    copy_to,
    inlined,
    kernel,
    linear,
    linear_of,
    normalize,
    rectify,
)
from .map_reader import REACH

_TURN = np.float32(2 * math.pi)
_TWO = np.float32(2.0)
_DISPLACEMENT_UNIT = np.float32(DISPLACEMENT_UNIT)
_WAY_UNIT = np.float32(WAY_UNIT)
_SCALE_RATE = np.float32(SCALE_RATE)
_PERIODS = np.array(PERIODS, np.float32)
_WIDTHS = np.array(WIDTHS, np.float32)
# What the numbers of a latent state and of a step are, as in `hypermodel._moved_by`: first in the body's frame, then in
# the map's.
X, Y, SINE, COSINE, SPEED_FORWARD, SPEED_LEFT, SPEED_TURN = range(NUM_BODY)
FORWARD, LEFT, TURN, NEXT_FORWARD, NEXT_LEFT, NEXT_TURN = range(NUM_FREE)
MAP_X, MAP_Y, MAP_SPEED_X, MAP_SPEED_Y = range(NUM_FREE, NUM_CHANGES)
_NEGLIGIBLE = np.float32(-20.0)  # logits so far below the highest have no weight in float32


class Weights(NamedTuple):
    """The weights that are the same for all contexts."""

    scale: np.ndarray  # [2, 2], of the map
    steepness: np.float32
    places: np.ndarray  # [NUM_PLACE], weights of the code of places
    num_bins: int
    body: tuple[Linear, Linear]
    heads: Linear


class Generated(NamedTuple):
    """The transition's weights of each context, by the names of `MMNNetwork.generated`."""

    bias: np.ndarray  # [C, 1, H]
    inputs: np.ndarray  # [C, D + NUM_PLACE, H]
    actions: np.ndarray  # [C, NUM_ACTIONS, H]
    ahead: np.ndarray  # [C, NUM_STOPPED, H]
    second: np.ndarray  # [C, H, NUM_CHANGES + D - NUM_BODY]
    second_bias: np.ndarray  # [C, 1, NUM_CHANGES + D - NUM_BODY]
    free: np.ndarray  # [C, 3, NUM_FREE]
    free_bias: np.ndarray  # [C, 1, NUM_FREE]
    free_actions: np.ndarray  # [C, NUM_ACTIONS, NUM_FREE]


class Model(NamedTuple):
    """A network and the codes of contexts, each of which belongs to as many neighbouring roots."""

    weights: Weights
    positions: np.ndarray  # [C, 4], anchor and goal on the map, each (row, column)
    generated: Generated
    rows: np.ndarray  # [C, M * M, H], the first layer's weights of each cell; no columns without them
    task: np.ndarray  # [C, T], the heads' code of the context
    features: np.ndarray  # [C, M * M, F], the heads' features of each cell; no columns without them
    num_roots: int  # of each context


# The weights of each network, and copies of the parameters that they were made of.
_copied: WeakKeyDictionary[MMNNetwork, tuple[list[np.ndarray], Weights]] = WeakKeyDictionary()


def kernel_model(network: MMNNetwork, latent: torch.Tensor, code: Code) -> tuple[Root, KernelModel]:
    """Returns roots and model of a search from latent states `[G, K, D]` on the CPU."""
    generated = {name: part.contiguous().numpy() for name, part in network.generated(code).items()}
    rest = {name: getattr(code, name).contiguous().numpy() for name in ("positions", "rows", "task", "features")}
    model = Model(weights_of(network), generated=Generated(**generated), num_roots=latent.shape[1], **rest)

    num_roots, num_latent = latent.shape[0] * latent.shape[1], latent.shape[2]
    states = np.empty((num_roots, 1, num_latent + model.generated.bias.shape[2]), np.float32)
    states[:, ROOT, :num_latent] = latent.flatten(0, 1).numpy()
    evaluation = empty_evaluation(num_roots, NUM_ACTIONS)
    arrive(model, 0, states, ROOT, evaluation)
    root = Root(evaluation.prior_logits, evaluation.value, torch.from_numpy(states[:, ROOT]))
    return root, KernelModel(search, model)


def weights_of(network: MMNNetwork) -> Weights:
    """Returns the weights of a network as they are now; they are transposed only where a parameter has changed."""
    sharpness = network.hypermodel.sharpness
    parameters = (network.scale, sharpness, *network.body.parameters(), *network.heads.parameters())
    values = [parameter.detach().numpy() for parameter in parameters]
    copied = _copied.get(network)
    if copied is None or not all(map(np.array_equal, copied[0], values)):
        weights = Weights(
            scale=network.scale.detach().numpy().copy(),
            steepness=np.float32(steepness(sharpness.detach())),
            places=network.place_weights.numpy(),
            num_bins=network.num_bins,
            body=(linear_of(network.body[0]), linear_of(network.body[2])),
            heads=linear_of(network.heads),
        )
        _copied[network] = copied = [value.copy() for value in values], weights
    return copied[1]


@functools.partial(kernel, nogil=True)
def search(
    model: Model,
    first: int,
    tree: np.ndarray,
    gumbel: np.ndarray,
    visits: np.ndarray,
    settings: Settings,
    roots: np.ndarray,
) -> None:
    """Runs all simulations from neighbouring roots, of which `first` is the index of the first one."""
    states = np.empty((*tree.shape, roots.shape[1]), np.float32)
    for b in range(len(roots)):
        copy_to(roots[b], states[b, ROOT])
    run_simulations(step, model, first, tree, gumbel, visits, settings, states)


@kernel
def step(
    model: Model,
    first: int,
    states: np.ndarray,
    parents: np.ndarray,
    actions: np.ndarray,
    index: int,
    evaluation: Evaluation,
) -> None:
    """Writes what follows from `actions` `[n]` in `states[:, parents]` into `states[:, index]` and `evaluation`."""
    generated = model.generated
    num_hidden, num_changes = generated.second.shape[1:]
    num_latent = NUM_BODY + num_changes - NUM_CHANGES
    free = np.empty(NUM_FREE, np.float32)
    hidden, change = np.empty((1, num_hidden), np.float32), np.empty((1, num_changes), np.float32)
    for b in range(len(states)):
        before, after, action = states[b, parents[b]], states[b, index], actions[b]
        c = (first + b) // model.num_roots

        # The motion, were there no walls.
        for j in range(NUM_FREE):
            free[j] = generated.free_bias[c, 0, j] + generated.free_actions[c, action, j]
            for i in range(NUM_BODY - NUM_POSE):
                free[j] += before[NUM_POSE + i] * generated.free[c, i, j]

        # The layer that knows the map, and the changes that follow from it.
        move_x, move_y = rotated(free[FORWARD], free[LEFT], before[SINE], before[COSINE])
        speed_x, speed_y = rotated(free[NEXT_FORWARD], free[NEXT_LEFT], before[SINE], before[COSINE])
        ahead = generated.ahead[c]
        for j in range(num_hidden):
            total = before[num_latent + j] + generated.bias[c, 0, j] + generated.actions[c, action, j]
            total += move_x * ahead[0, j] + move_y * ahead[1, j] + speed_x * ahead[2, j] + speed_y * ahead[3, j]
            hidden[0, j] = total
        normalize(hidden[0])
        rectify(hidden[0])
        copy_to(generated.second_bias[c, 0], change[0])
        add_product(hidden, generated.second[c], change)

        # The body after the step, as `hypermodel._moved_by`.
        changed, sine, cosine = change[0], before[SINE], before[COSINE]
        x, y = rotated(free[FORWARD] + changed[FORWARD], free[LEFT] + changed[LEFT], sine, cosine)
        after[X] = before[X] + x + changed[MAP_X]
        after[Y] = before[Y] + y + changed[MAP_Y]
        turn = free[TURN] + changed[TURN]
        after[COSINE], after[SINE] = rotated(cosine, sine, math.sin(turn), math.cos(turn))
        forward, left = rotated(changed[MAP_SPEED_X], changed[MAP_SPEED_Y], -sine, cosine)
        after[SPEED_FORWARD] = free[NEXT_FORWARD] + changed[NEXT_FORWARD] + forward
        after[SPEED_LEFT] = free[NEXT_LEFT] + changed[NEXT_LEFT] + left
        after[SPEED_TURN] = free[NEXT_TURN] + changed[NEXT_TURN]

        # The motion's code.
        for j in range(NUM_BODY, num_latent):
            after[j] = before[j] + change[0, NUM_CHANGES - NUM_BODY + j]
        normalize(after[NUM_BODY:num_latent])
    arrive(model, first, states, index, evaluation)


@kernel
def arrive(model: Model, first: int, states: np.ndarray, index: int, evaluation: Evaluation) -> None:
    """Completes `states[:, index]`, whose latent states are given, by the first layers; writes the `evaluation`."""
    weights, num_roots = model.weights, len(states)
    num_features, num_codes = model.features.shape[2], model.task.shape[1]
    num_inputs = model.generated.inputs.shape[1]
    num_latent = num_inputs - NUM_PLACE
    size = round(math.sqrt(model.features.shape[1]))
    near = np.empty((2, 2 * REACH), np.float32)
    x = np.empty((num_roots, num_inputs + NUM_TO_GOAL + num_codes + num_features), np.float32)
    for b in range(num_roots):
        latent, first_layer = states[b, index, :num_latent], states[b, index, num_latent:]
        c = (first + b) // model.num_roots
        positions, scale = model.positions[c], weights.scale

        # The estimated position, and the cells around it.
        row = positions[0] + _SCALE_RATE * (latent[X] * scale[0, 0] + latent[Y] * scale[1, 0])
        column = positions[1] + _SCALE_RATE * (latent[X] * scale[0, 1] + latent[Y] * scale[1, 1])
        first_row, first_column = weigh_cells(row, column, weights.steepness, size, near)

        # The inputs of all layers.
        write_inputs(latent, row, column, positions, size, x[b])
        for j in range(NUM_PLACE):
            x[b, num_latent + j] *= weights.places[j]

        # The first layer: a row of its weights is read from the map.
        first_layer[:] = ZERO
        add_read(first_row, first_column, near, size, model.rows[c], first_layer)
        add_product(x[b, :num_inputs].reshape(1, -1), model.generated.inputs[c], first_layer.reshape(1, -1))

        # What the heads get beside: the way to the goal, the context's code, and features that are read from the map.
        k = num_inputs
        rows_away, columns_away = positions[2] - row, positions[3] - column  # as `layers.goal_code`
        x[b, k], x[b, k + 1] = rows_away / _WAY_UNIT, columns_away / _WAY_UNIT
        for i in range(len(_WIDTHS)):
            distance = rows_away * rows_away + columns_away * columns_away
            x[b, k + 2 + i] = math.exp(-distance / _WIDTHS[i])
        k += NUM_TO_GOAL
        copy_to(model.task[c], x[b, k : k + num_codes])
        k += num_codes
        x[b, k:] = ZERO
        add_read(first_row, first_column, near, size, model.features[c], x[b, k:])

    # The heads.
    hidden_1 = np.empty((num_roots, len(weights.body[0].bias)), np.float32)
    hidden_2 = np.empty((num_roots, len(weights.body[1].bias)), np.float32)
    outputs = np.empty((num_roots, len(weights.heads.bias)), np.float32)
    linear(x, weights.body[0], hidden_1)
    rectify(hidden_1.reshape(-1))
    linear(hidden_1, weights.body[1], hidden_2)
    rectify(hidden_2.reshape(-1))
    linear(hidden_2, weights.heads, outputs)

    # Policies, values, rewards and discounts.
    num_bins = weights.num_bins
    for b in range(num_roots):
        copy_to(outputs[b], evaluation.prior_logits[b])

        # The mean of a categorical value.
        logits = outputs[b, NUM_ACTIONS : NUM_ACTIONS + num_bins]
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
        evaluation.value[b] = weighted / total

        # Reward and discount of arriving there: a goal ends the episode, any other step costs 1.
        discount = ONE / (ONE + np.float32(math.exp(outputs[b, NUM_ACTIONS + num_bins])))
        evaluation.reward[b], evaluation.discount[b] = -discount, discount


@kernel
def weigh_cells(
    row: np.float32, column: np.float32, steepness: np.float32, size: int, near: np.ndarray
) -> tuple[int, int]:
    """Writes the weights of the rows and of the columns around a position into `near` `[2, 2 * REACH]`.

    Returns the first row and the first column; see `map_reader.read`.
    """
    first = np.empty(2, np.int64)
    for axis in range(2):
        place = min(max(row if axis == 0 else column, ZERO), np.float32(size - 1))
        first[axis] = math.floor(place) + 1 - REACH
        total = ZERO
        for i in range(2 * REACH):
            cell = first[axis] + i
            distance = (place - np.float32(cell)) * (place - np.float32(cell))
            inside = 0 <= cell < size and distance < np.float32(REACH**2)
            near[axis, i] = math.exp(-steepness * distance) if inside else ZERO
            total += near[axis, i]
        for i in range(2 * REACH):
            near[axis, i] /= total
    return first[0], first[1]


@inlined
def add_read(
    first_row: int, first_column: int, near: np.ndarray, size: int, table: np.ndarray, out: np.ndarray
) -> None:
    """Adds the rows of a table `[M * M, columns]` to `out`, with the weights of the cells that `weigh_cells` gave."""
    for i in range(2 * REACH):
        for k in range(2 * REACH):
            weight = near[0, i] * near[1, k]
            if weight > ZERO:
                cell = table[(first_row + i) * size + first_column + k]
                for j in range(len(cell)):
                    out[j] += weight * cell[j]


@inlined
def write_inputs(
    latent: np.ndarray, row: np.float32, column: np.float32, positions: np.ndarray, size: int, out: np.ndarray
) -> None:
    """Writes `MMNNetwork._inputs`: the latent state, the places by `layers.place_code`."""
    num_latent, num_periods, middle = len(latent), len(_PERIODS), (np.float32(size) - ONE) / _TWO
    unit = _TWO / np.float32(size)
    copy_to(latent[2:], out[: num_latent - 2])
    k = num_latent - 2
    for axis in range(2):
        place = row if axis == 0 else column
        out[k + axis] = latent[axis] / _DISPLACEMENT_UNIT
        out[k + 2 + axis] = (place - middle) * unit
        for i in range(num_periods):
            phase = place * (_TURN / _PERIODS[i])
            wave = k + 8 + 2 * num_periods * axis + i
            out[wave], out[wave + num_periods] = math.sin(phase), math.cos(phase)
    for i in range(4):
        out[k + 4 + i] = (positions[i] - middle) * unit


@inlined
def rotated(x: np.float32, y: np.float32, sine: np.float32, cosine: np.float32) -> tuple[np.float32, np.float32]:
    """Returns a vector, turned by an angle."""
    return cosine * x - sine * y, sine * x + cosine * y
