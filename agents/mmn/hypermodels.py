"""Hypermodels: they generate weights of the latent transition network from a context, once a leg.

There are three with one interface. `spatial` generates the weights of the first layer that act on the position, a row
for each cell of the map. `flat`, our reading of the paper, generates every weight from one code of the context. `none`,
for ablations, gives that code to an ordinary network as an input.

`G` is the number of contexts, `K` of latent states in each, `M` the side of the context, `I` the size of a transition's
input, `H` of its hidden layer, `O` of its output, `T` the number of task features.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import nn
from torch.nn import functional

from ..common.layers import NUM_PLANES, MapEncoder, marked_position
from .config import MMNConfig

NUM_ACTIONS = 6
_FIRST_COST = 2.0  # steps a cell, before anything is learned
_BARRED = 100.0  # steps to enter a wall: longer than any detour
_FAR = 1000.0  # steps; farther than any path
_SHALLOW = (1, 1, 1)  # dilations of the map's convolutions, where distances are propagated
_DEEP = (1, 1, 2, 2, 4, 4, 2, 1, 1)  # likewise, where they are not, and the convolutions must see 19 cells far
_EMBEDDING = 256  # of a whole context in one code
_CODE_CHANNELS = 24
_FLAT_HIDDEN = 64  # of the transition whose weights are all predicted
_TASK_CODE = 64  # numbers of that code for the heads


class Code(NamedTuple):
    """The output of a hypermodel for a context."""

    positions: torch.Tensor  # [G, 4], anchor and goal on the map, each (row, column)
    weights: torch.Tensor  # [G, ..., W], of the transition network, followed by the features for the heads
    distance: torch.Tensor  # [G, P, M, M], learned steps to the goal; P is 0 where none are propagated
    enterable: torch.Tensor  # [G, 1, M, M], logits that cells can be entered; 0 planes where P is 0

    def of(self, rows: slice | torch.Tensor) -> Code:
        """Returns the codes of some of the contexts."""
        return Code(*(part[rows] for part in self))


class Hypermodel(nn.Module):
    """The interface of a transition network whose weights come from a context."""

    num_task_features: int  # T
    hidden: int  # H

    def forward(self, context: torch.Tensor, anchor: torch.Tensor | None = None) -> Code:
        """Returns the code of contexts `[G, 4, M, M]`.

        Displacements are measured from `anchor` `[G, 2]`, a position (row, column), by default the marked start.
        """
        raise NotImplementedError

    def look(self, position: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns what is read from the context at positions (row, column) `[G, K, 2]`, `[G, K, W]`."""
        raise NotImplementedError

    def first_layer(self, inputs: torch.Tensor, seen: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the first layer without the action, `[G, K, H]`, of inputs `[G, K, I]` and what `look` read."""
        raise NotImplementedError

    def later_layers(self, first: torch.Tensor, action: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the transition's output `[G, K, O]`, with actions `[G, K]`."""
        raise NotImplementedError

    def task_features(self, seen: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns features of the context `[G, K, T]` for the heads."""
        raise NotImplementedError


class Propagation(nn.Module):
    """Distances to the goal on a map whose costs are learned: shortest paths by repeated relaxation.

    Value propagation with max-pooling (Nardelli et al. 2019, MVProp), with sums of costs instead of products of
    discounts. The cost to leave a cell is learned through the resulting distances; whether a cell can be entered is
    learned from the cells that were visited.
    """

    def __init__(self, num_features: int, num_distances: int):
        super().__init__()
        self.enterable = nn.Conv2d(num_features, 1, 1)
        self.cost = nn.Conv2d(num_features, num_distances, 1)

    def forward(self, features: torch.Tensor, goal: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Returns distances `[G, P, M, M]`, and logits `[G, 1, M, M]` that cells can be entered.

        Args:
          features: `[G, C, M, M]`, of the map.
          goal: `[G, 1, M, M]`, 1 at the goal.
        """
        enterable = self.enterable(features)
        cost = functional.softplus(_FIRST_COST + self.cost(features)) + _BARRED * torch.sigmoid(-enterable.detach())
        distance = (_FAR * (goal < 1)).expand_as(cost)
        for _ in range(2 * goal.shape[-1]):
            nearness = torch.maximum(
                functional.max_pool2d(-distance, (3, 1), 1, (1, 0)), functional.max_pool2d(-distance, (1, 3), 1, (0, 1))
            )
            distance = torch.minimum(distance, cost - nearness)
        return distance, enterable

    @staticmethod
    def slopes(distance: torch.Tensor) -> torch.Tensor:
        """Returns `[G, 5 P, M, M]`: the neighbours' distances minus a cell's own, and its own, of order one."""
        padded = functional.pad(distance, (1, 1, 1, 1), value=_FAR)
        neighbours = (padded[..., :-2, 1:-1], padded[..., 2:, 1:-1], padded[..., 1:-1, :-2], padded[..., 1:-1, 2:])
        slopes = [((neighbour - distance) / 3).clamp(-2, 2) for neighbour in neighbours]
        return torch.cat([*slopes, (distance / 30).clamp(max=4)], dim=1)


class _Transition(nn.Module):
    """The learned layers of a transition; a hypermodel adds to the first one."""

    def __init__(self, num_inputs: int, hidden: int, num_outputs: int):
        super().__init__()
        self.inputs = nn.Linear(num_inputs, hidden)
        self.actions = nn.Embedding(NUM_ACTIONS, hidden)
        nn.init.normal_(self.actions.weight, std=0.3)  # like the other terms of the first layer
        self.later = nn.Sequential(nn.Linear(hidden, hidden), nn.ReLU(inplace=True), nn.Linear(hidden, num_outputs))

    def forward(self, first: torch.Tensor, action: torch.Tensor) -> torch.Tensor:
        return self.later(functional.relu(first + self.actions(action), inplace=True))


class SpatialHypermodel(Hypermodel):
    """Generates a row of weights for each cell, for contexts of any size."""

    def __init__(self, config: MMNConfig, num_inputs: int, num_outputs: int, context_size: int):
        super().__init__()
        self.encoder = MapEncoder(config.channels, _SHALLOW if config.num_distances else _DEEP)
        self.num_task_features = config.channels + NUM_PLANES
        self.rows = nn.Conv2d(self.num_task_features, config.hidden, 1)
        self.propagation = Propagation(self.num_task_features, config.num_distances) if config.num_distances else None
        self.num_task_features += 5 * config.num_distances
        self.sharpness = nn.Parameter(torch.tensor(0.0))
        self.hidden = config.hidden
        self.transition = _Transition(num_inputs, config.hidden, num_outputs)

    def forward(self, context: torch.Tensor, anchor: torch.Tensor | None = None) -> Code:
        encoded = self.encoder(context)
        features = torch.cat([encoded, context], dim=1)
        rows = self.rows(features)  # [G, H, M, M]
        distance = enterable = encoded[:, :0]
        if self.propagation is not None:
            distance, enterable = self.propagation(features, context[:, 2:3])
            features = torch.cat([features, self.propagation.slopes(distance)], dim=1)
        table = torch.cat([rows, features], dim=1).flatten(2).transpose(1, 2)  # [G, M * M, H + T]
        return Code(_marked_positions(context, anchor), table, distance, enterable)

    def look(self, position: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns rows of weights and of task features, interpolated."""
        return self.read(position, code.weights)

    def read(self, position: torch.Tensor, table: torch.Tensor) -> torch.Tensor:
        """Returns rows of tables `[G, M * M, R]`, interpolated at positions `[G, K, 2]`: `[G, K, R]`.

        In each direction, the cells less than two away are weighted by their distance: at most four.
        """
        size = math.isqrt(table.shape[1])
        position = position.clamp(0, size - 1)
        sharpness = functional.softplus(self.sharpness + 1.0)
        if position.shape[1] > 1:  # one product for all positions of a map
            return _outer(_nearness(position, torch.arange(size, device=position.device), sharpness)) @ table
        cells = position.floor()[..., None] + torch.arange(-1, 3, device=position.device)  # [G, 1, 2, 4]
        inside = (cells >= 0) & (cells < size)
        row, column = cells.clamp(0, size - 1).long().unbind(-2)
        index = (row[..., :, None] * size + column[..., None, :]).flatten(1)  # [G, 16]
        index = index + size**2 * torch.arange(len(position), device=position.device)[:, None]
        rows = table.flatten(0, 1).index_select(0, index.flatten()).unflatten(0, index.shape)
        return _outer(_nearness(position, cells, sharpness, inside)) @ rows

    def first_layer(self, inputs: torch.Tensor, seen: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the learned layer plus the generated rows."""
        return self.transition.inputs(inputs) + seen[..., : -self.num_task_features]

    def later_layers(self, first: torch.Tensor, action: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the output of learned layers, the same in all contexts."""
        return self.transition(first, action)

    def task_features(self, seen: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the features of the map that were read."""
        return seen[..., -self.num_task_features :]

    def distances(self, position: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the learned steps `[G, K, P]` to the goal from positions `[G, K, 2]`."""
        return self.read(position, code.distance.flatten(2).transpose(1, 2))


class CodeHypermodel(Hypermodel):
    """The parts that `flat` and `none` share: one code of a whole context, whose size M is fixed."""

    num_task_features = _TASK_CODE + 2

    def __init__(self, context_size: int):
        super().__init__()
        self._size = context_size
        self.encoder = MapEncoder(_CODE_CHANNELS, (1, 1, 1, 1))
        self.embedding = nn.Sequential(
            nn.Linear(_CODE_CHANNELS * context_size**2, _EMBEDDING), nn.LayerNorm(_EMBEDDING), nn.ReLU()
        )
        self.task = nn.Linear(_EMBEDDING, _TASK_CODE)

    def forward(self, context: torch.Tensor, anchor: torch.Tensor | None = None) -> Code:
        embedding = self.embedding(self.encoder(context).flatten(1))
        nothing = context[:, :0]
        weights = torch.cat([self.weights(embedding), self.task(embedding)], dim=-1)
        return Code(_marked_positions(context, anchor), weights, nothing, nothing)

    def weights(self, embedding: torch.Tensor) -> torch.Tensor:
        """Returns the weights, or inputs, for the transition from embeddings `[G, 256]` of contexts."""
        raise NotImplementedError

    def look(self, position: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the position itself, in [-1, 1]."""
        return (position - (self._size - 1) / 2) * (2 / self._size)

    def task_features(self, seen: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the position and a code of the context."""
        return torch.cat([seen, code.weights[:, None, -_TASK_CODE:].expand(-1, seen.shape[1], -1)], dim=-1)


class FlatHypermodel(CodeHypermodel):
    """Generates all weights of a transition with one hidden layer.

    At first they are those of an ordinary network, nearly equal for all contexts: Bias-HyperInit (Beck et al. 2022).
    """

    hidden = _FLAT_HIDDEN

    def __init__(self, config: MMNConfig, num_inputs: int, num_outputs: int, context_size: int):
        super().__init__(context_size)
        self._num_inputs = num_inputs + 2
        self._shapes = (
            (self._num_inputs + NUM_ACTIONS, _FLAT_HIDDEN),
            (1, _FLAT_HIDDEN),
            (_FLAT_HIDDEN, num_outputs),
            (1, num_outputs),
        )
        self.hyper = nn.Linear(_EMBEDDING, sum(rows * columns for rows, columns in self._shapes))
        nn.init.normal_(self.hyper.weight, std=0.02 / math.sqrt(_EMBEDDING))
        usual = [torch.randn(rows * columns) / math.sqrt(rows) * (rows > 1) for rows, columns in self._shapes]
        with torch.no_grad():
            self.hyper.bias.copy_(torch.cat(usual))

    def weights(self, embedding: torch.Tensor) -> torch.Tensor:
        """Returns all weights of the transition, flattened."""
        return self.hyper(embedding)

    def first_layer(self, inputs: torch.Tensor, seen: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the layer with generated weights."""
        first, bias, _, _ = self._parts(code)
        return torch.cat([inputs, seen], dim=-1) @ first[:, : self._num_inputs] + bias

    def later_layers(self, first: torch.Tensor, action: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the output of layers with generated weights."""
        rows, _, second, bias = self._parts(code)
        chosen = functional.one_hot(action, NUM_ACTIONS).to(first.dtype) @ rows[:, self._num_inputs :]
        hidden = functional.relu(functional.layer_norm(first + chosen, first.shape[-1:]))
        return hidden @ second + bias

    def _parts(self, code: Code) -> list[torch.Tensor]:
        """Returns the generated weights and biases, each `[G, rows, columns]`."""
        parts = code.weights[:, :-_TASK_CODE].split([rows * columns for rows, columns in self._shapes], dim=-1)
        return [part.unflatten(-1, shape) for part, shape in zip(parts, self._shapes, strict=True)]


class NoHypermodel(CodeHypermodel):
    """An ordinary transition network, of which the context's code is one more input."""

    def __init__(self, config: MMNConfig, num_inputs: int, num_outputs: int, context_size: int):
        super().__init__(context_size)
        self.hidden = config.hidden
        self.of_context = nn.Linear(_EMBEDDING, config.hidden)
        self.transition = _Transition(num_inputs + 2, config.hidden, num_outputs)

    def weights(self, embedding: torch.Tensor) -> torch.Tensor:
        """Returns what the context adds to the first layer."""
        return self.of_context(embedding)

    def first_layer(self, inputs: torch.Tensor, seen: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the learned layer of the inputs, the position and the context's code."""
        return self.transition.inputs(torch.cat([inputs, seen], dim=-1)) + code.weights[:, None, :-_TASK_CODE]

    def later_layers(self, first: torch.Tensor, action: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the output of learned layers."""
        return self.transition(first, action)


HYPERMODELS = {"spatial": SpatialHypermodel, "flat": FlatHypermodel, "none": NoHypermodel}


def _marked_positions(context: torch.Tensor, anchor: torch.Tensor | None) -> torch.Tensor:
    """Returns `[G, 4]`: the anchor, by default the marked start, and the marked goal."""
    start, goal = (marked_position(context[:, plane]) for plane in (3, 2))
    return torch.cat([start if anchor is None else anchor, goal], dim=-1)


def _nearness(
    position: torch.Tensor, cells: torch.Tensor, sharpness: torch.Tensor, inside: torch.Tensor | None = None
) -> torch.Tensor:
    """Returns soft one-hots `[G, K, 2, n]` of positions `[G, K, 2]` over n rows and columns; 0 two or more away."""
    distance = (position[..., None] - cells) ** 2
    near = distance < 4
    if inside is not None:
        near = near & inside
    return torch.softmax((-sharpness * distance).masked_fill(~near, -torch.inf), dim=-1)


def _outer(weight: torch.Tensor) -> torch.Tensor:
    """Returns weights of cells `[G, K, n * n]` from those of rows and columns `[G, K, 2, n]`."""
    return (weight[..., 0, :, None] * weight[..., 1, None, :]).flatten(-2)
