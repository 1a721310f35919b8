"""The network of MMN: the weights of the transition are generated from the context.

`G` is the number of contexts, `K` of latent states in each, `M` the side of the context, `H` the size of the
transition's hidden layer, `T` of the heads' code of the context, `C` the number of features of a cell.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import torch
from torch import nn
from torch.nn import functional

from ..common.layers import (
    DISPLACEMENT_UNIT,
    NUM_PLACE,
    NUM_PLANES,
    NUM_TO_GOAL,
    MapEncoder,
    goal_code,
    place_code,
)
from ..muzero.network import (
    NUM_ACTIONS,
    NUM_BODY,
    NUM_CHANGES,
    NUM_FREE,
    NUM_POSE,
    NUM_STOPPED,
    Network,
    Predictions,
    ahead_of,
    marked_positions,
    moved_by,
)
from ..muzero.reading import read
from .config import MMNConfig

_CHANNELS = 24  # of the map's convolutions
_NEAR = (1, 1, 1, 1)  # dilations of the hypermodel's convolutions
_FAR = (1, 1, 2, 2, 4, 4, 2, 1, 1)  # of the heads', which see 19 cells far, across a 13 x 13 map
_FIRST_VALUE = -20.0  # steps; the middle of the values before anything is learned
_FIRST_CHANGE = 0.1  # times the usual size: the transition's output before anything is learned


class Code(NamedTuple):
    """The output of the hypermodel for a context, and what the heads get of the context."""

    positions: torch.Tensor  # [G, 4], start and goal on the map, each (row, column)
    weights: torch.Tensor  # [G, W], the transition's, but for those below
    rows: torch.Tensor  # [G, M * M, H], the first layer's weights of each cell's position; no columns without them
    task: torch.Tensor  # [G, T], the heads' code of the context
    features: torch.Tensor  # [G, M * M, C], the heads' features of each cell; no columns without them


class MMNNetwork(Network):
    """Has a transition of one hidden layer, all of whose weights are generated.

    It learns, and on a GPU it acts. On a CPU, searches use `kernel_model.py`, which computes the same: a change of what
    acts is made in both.
    """

    hypermodel: Hypermodel

    def __init__(self, config: MMNConfig, context_size: int):
        super().__init__(config)
        self.hidden_size = config.hidden
        self._size = context_size
        num_inputs = NUM_BODY + config.latent + NUM_PLACE
        self._shapes = _weight_shapes(num_inputs, config.hidden, NUM_CHANGES + config.latent)
        self.hypermodel = Hypermodel(config, self._shapes, context_size)
        self.scale = nn.Parameter(torch.zeros(2, 2))
        num_inputs += NUM_TO_GOAL + config.task_code + self.hypermodel.num_features
        self._make_heads(num_inputs, NUM_ACTIONS + self.num_bins + 1, config)
        with torch.no_grad():
            self.heads.bias[NUM_ACTIONS:-1] = -(self.support - _FIRST_VALUE).abs() / 3
        self._rates = {"hypermodel.hyper.weight": config.hyper_rate, "scale": config.scale_rate}

    def parameter_groups(self) -> list[dict[str, Any]]:
        """Returns groups of their own for the layer that generates weights, and for the map's scale."""
        groups: list[dict[str, Any]] = [{"params": [], "rate": rate} for rate in (1.0, *self._rates.values())]
        for name, parameter in self.named_parameters():
            index = next((1 + i for i, prefix in enumerate(self._rates) if name.startswith(prefix)), 0)
            groups[index]["params"].append(parameter)
        return groups

    def reanchored(self, anchor: torch.Tensor, moved: torch.Tensor, start: torch.Tensor) -> torch.Tensor:
        """Returns `anchor` `[G, 2]`, shifted just enough that the estimated position lies in the `start` cell.

        The estimated position is that of a body displaced by `moved` `[G, 2]` (m) from the anchor.
        """
        position = anchor + self.on_map(moved)
        return anchor + torch.clamp(position, start - 0.5, start + 0.5) - position

    def look(self, latent: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns a code of the estimated position, start and goal; then the rows and the features read there.

        No gradient reaches the position from here: what tells goals apart, in `predict`, trains it.
        """
        position = self.locate(latent, code).detach()
        table = torch.cat([code.rows, code.features], dim=-1)
        seen = read(position, table, self.hypermodel.sharpness)
        return torch.cat([place_code(position, code.positions, self._size), seen], dim=-1)

    def generated(self, code: Code) -> dict[str, torch.Tensor]:
        """Returns the transition's weights by name, each `[G, rows, columns]`, but for the rows of cells."""
        parts = code.weights.split([rows * columns for rows, columns in self._shapes.values()], dim=-1)
        return {
            name: part.unflatten(-1, shape) for (name, shape), part in zip(self._shapes.items(), parts, strict=True)
        }

    def first_layer(self, latent: torch.Tensor, seen: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the layer with generated weights."""
        weights = self.generated(code)
        first = self._inputs(latent, seen) @ weights["inputs"] + weights["bias"]
        if code.rows.shape[-1]:
            first = first + seen[..., NUM_PLACE : NUM_PLACE + first.shape[-1]]
        return first

    def step(self, latent: torch.Tensor, first: torch.Tensor, action: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the next latent states."""
        weights = self.generated(code)
        chosen = functional.one_hot(action, NUM_ACTIONS).to(first.dtype)
        free = (
            latent[..., NUM_POSE:NUM_BODY] @ weights["free"] + weights["free_bias"] + chosen @ weights["free_actions"]
        )
        first = first + chosen @ weights["actions"] + ahead_of(free, latent) @ weights["ahead"]
        hidden = functional.relu(functional.layer_norm(first, first.shape[-1:]))
        body, motion = moved_by(latent, free, hidden @ weights["second"] + weights["second_bias"])
        motion = functional.layer_norm(latent[..., NUM_BODY:] + motion, motion.shape[-1:])
        return torch.cat([body, motion], dim=-1)

    def predict(self, latent: torch.Tensor, seen: torch.Tensor, code: Code) -> Predictions:
        """Returns the outputs of the heads."""
        to_goal = goal_code(self.locate(latent, code), code.positions[:, 2:])
        task = code.task[:, None].expand(-1, latent.shape[1], -1)
        features = seen[..., NUM_PLACE + code.rows.shape[-1] :]
        out = self.heads(self.body(torch.cat([self._inputs(latent, seen), to_goal, task, features], dim=-1)))
        return Predictions(out[..., :NUM_ACTIONS], out[..., NUM_ACTIONS:-1], out[..., -1])

    def _inputs(self, latent: torch.Tensor, seen: torch.Tensor) -> torch.Tensor:
        """Returns `[G, K, D + 34]`: the latent state, with 5 m as the unit of the displacement, and the places."""
        return torch.cat([latent[..., 2:], latent[..., :2] / DISPLACEMENT_UNIT, seen[..., :NUM_PLACE]], dim=-1)


class Hypermodel(nn.Module):
    """Generates the weights from a code of the whole context, of a fixed size, and a row for each cell's position.

    At first the weights are those of an ordinary network, nearly equal for all contexts: Bias-HyperInit (Beck et al.
    2022). The rows come from convolutions, so that patterns of walls that mazes share are learned once.
    """

    def __init__(self, config: MMNConfig, shapes: dict[str, tuple[int, int]], context_size: int):
        super().__init__()
        self.encoder = MapEncoder(_CHANNELS, _NEAR)
        size = config.embedding
        self.embedding = nn.Sequential(nn.Linear(_CHANNELS * context_size**2, size), nn.LayerNorm(size))
        self.task = nn.Linear(size, config.task_code)
        ordinary = torch.cat([_ordinary(name, shapes).flatten() for name in shapes])
        self.shared: nn.Parameter | None = None
        if config.hypermodel:
            self.hyper = nn.Linear(size, len(ordinary))
            with torch.no_grad():
                self.hyper.bias.copy_(ordinary)
        else:
            self.shared = nn.Parameter(ordinary)
            self.hyper = nn.Linear(size, config.hidden)
        nn.init.normal_(self.hyper.weight, std=0.02 / math.sqrt(size))
        num_encoded = _CHANNELS + NUM_PLANES
        self.rows = nn.Conv2d(num_encoded, config.hidden, 1) if config.rows else None
        self.reader = MapEncoder(_CHANNELS, _FAR) if config.reading else None
        self.num_features = num_encoded * config.reading
        self.sharpness = nn.Parameter(torch.tensor(0.0))

    def forward(self, context: torch.Tensor, anchor: torch.Tensor | None = None) -> Code:
        """Returns the code of contexts `[G, 4, M, M]`; displacements are measured from `anchor` `[G, 2]`."""
        encoded = self.encoder(context)
        embedding = self.embedding(encoded.flatten(1))
        weights = self.hyper(embedding / math.sqrt(embedding.shape[-1]))
        if self.shared is not None:  # the context's code is an input: it adds to the first layer alone
            weights = torch.cat([weights, weights.new_zeros(len(weights), len(self.shared) - weights.shape[-1])], -1)
            weights = weights + self.shared
        rows = features = context[:, :0]
        if self.rows is not None:
            rows = self.rows(torch.cat([encoded, context], dim=1))
        if self.reader is not None:
            features = torch.cat([self.reader(context), context], dim=1)
        rows, features = (planes.flatten(2).transpose(1, 2) for planes in (rows, features))
        return Code(marked_positions(context, anchor), weights, rows, self.task(functional.relu(embedding)), features)


def _weight_shapes(num_inputs: int, hidden: int, num_changes: int) -> dict[str, tuple[int, int]]:
    """Returns the rows and columns of the transition's weights; those of the first layer's bias come first."""
    return {
        "bias": (1, hidden),
        "inputs": (num_inputs, hidden),
        "actions": (NUM_ACTIONS, hidden),
        "ahead": (NUM_STOPPED, hidden),
        "second": (hidden, num_changes),
        "second_bias": (1, num_changes),
        "free": (NUM_BODY - NUM_POSE, NUM_FREE),
        "free_bias": (1, NUM_FREE),
        "free_actions": (NUM_ACTIONS, NUM_FREE),
    }


def _ordinary(name: str, shapes: dict[str, tuple[int, int]]) -> torch.Tensor:
    """Returns weights as an ordinary network has them at first: 0 for biases and for the free motion by action.

    They are numbers also while shapes are checked on the meta device, where arithmetic takes PyTorch seconds to load.
    """
    rows, columns = shapes[name]
    if name.endswith("bias") or name == "free_actions":
        return torch.zeros(rows, columns, device="cpu")
    num_inputs = {
        "inputs": rows + NUM_ACTIONS,
        "actions": shapes["inputs"][0] + NUM_ACTIONS,
        "ahead": 3 * rows,
        "free": 3 * rows,
    }
    scale = _FIRST_CHANGE if name == "second" else 1.0
    return scale * torch.randn(rows, columns, device="cpu") / math.sqrt(num_inputs.get(name, rows))
