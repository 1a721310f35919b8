"""The network of MMN: a model in latent states, the weights of whose transition are generated from the context.

`G` is the number of contexts, `K` of latent states in each, `M` the side of the context, `D` the size of a latent
state, `H` of the transition's hidden layer, `T` of the heads' code of the context, `C` the number of a cell's features.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from mazebench.constants import NUM_ACTIONS
from mazebench.tasks.context import GOAL

from ..common.layers import (
    DISPLACEMENT_UNIT,
    FAR_DILATIONS,
    NEAR_DILATIONS,
    NUM_PLACE,
    NUM_PLANES,
    NUM_TO_GOAL,
    SCALE_RATE,
    MapEncoder,
    dueling_values,
    goal_code,
    marked_position,
    place_code,
    place_weights,
)
from ..common.path_layer import FAR, CheapestWays, cell_costs, cost_layers
from .map_reader import read
from .mmn_config import MMNConfig

NUM_POSE = 4  # x and y moved, sine and cosine of yaw: the first numbers of a latent state, as of state features
NUM_BODY = 7  # and velocities forward, left and of yaw
NUM_FREE = 6  # of a step in the body's frame: a move, a turn, velocities forward, left and of yaw
NUM_STOPPED = 4  # in the map's: a move, velocities
NUM_CHANGES = NUM_FREE + NUM_STOPPED
# Contexts and states are computed as many at once, always, since PyTorch rounds differently at another batch size.
CONTEXTS_AT_ONCE = 16  # few are new in one step
STATES_AT_ONCE = 64
_CHANNELS = 24  # of the map's convolutions
_NUM_WAY = 8 + 3  # features of a cell by the ways to the goal
# Near goals teach that a wall costs some ten free cells. So that far ways go around walls, what costs more than this
# costs this many times as much where the agent does not explore.
_DEAR, _CLOSING = 10.0, 30.0
# Before anything is learned:
_FIRST_VALUE = -20.0  # steps; the middle of the values
_FIRST_GOAL = -4.0  # logit of being in the goal
_FIRST_CHANGE = 0.1  # times the usual size: the transition's output


class Code(NamedTuple):
    """The output of the hypermodel for a context, and what the heads get of the context."""

    positions: torch.Tensor  # [G, 4], anchor and goal on the map, each (row, column)
    weights: torch.Tensor  # [G, W], the transition's, but for those below
    rows: torch.Tensor  # [G, M * M, H], the first layer's weights of each cell's position; no columns without them
    task: torch.Tensor  # [G, T], the heads' code of the context
    features: torch.Tensor  # [G, M * M, C], the heads' features of each cell; no columns without them


class Predictions(NamedTuple):
    """The outputs of the heads for latent states."""

    policy_logits: torch.Tensor  # [G, K, 6]
    value_logits: torch.Tensor  # [G, K, bins], of whole values from 1 - bins to 0
    goal_logit: torch.Tensor  # [G, K], of being in the goal cell, which ends the episode


class MMNNetwork(nn.Module):
    """The paper's e (`encode`), h (`hypermodel`), f (`first_layer`, then `step`) and g (`predict`).

    A latent state holds the displacement from an anchor (m), heading, velocities and a learned code of the motion. The
    estimated position on the map is the anchor plus a learned linear map of the displacement. The transition f has one
    hidden layer, and all its weights are generated.

    Without a model (`config.model`), the heads give action values instead of policy and value. The learned codes of
    motion and context and the generated weights are then computed, but not used.

    It learns, and on a GPU it acts. On a CPU, searches use `kernel_model.py`, which computes the same: a change of what
    acts is made in both.
    """

    support: torch.Tensor  # [bins], the values that a categorical value weighs
    place_weights: torch.Tensor  # [34], of the code of places

    def __init__(self, config: MMNConfig, context_size: int):
        super().__init__()
        self.latent_size, self.hidden_size = NUM_BODY + config.latent, config.hidden
        self.num_bins = config.longest_value + 1
        self._size = context_size
        values = np.arange(-config.longest_value, 1, dtype=np.float32)
        self.register_buffer("support", torch.from_numpy(values), persistent=False)
        self.register_buffer("place_weights", place_weights(any_size=config.any_size), persistent=False)
        self.encoder = nn.Sequential(
            nn.Linear(NUM_BODY - NUM_POSE, config.hidden),
            nn.ReLU(inplace=True),
            nn.Linear(config.hidden, config.latent),
            nn.LayerNorm(config.latent),
        )

        num_inputs = self.latent_size + NUM_PLACE
        num_changes = NUM_CHANGES + config.latent
        self._shapes = {  # rows and columns of the transition's weights; those of the first layer's bias come first
            "bias": (1, config.hidden),
            "inputs": (num_inputs, config.hidden),
            "actions": (NUM_ACTIONS, config.hidden),
            "ahead": (NUM_STOPPED, config.hidden),
            "second": (config.hidden, num_changes),
            "second_bias": (1, num_changes),
            "free": (NUM_BODY - NUM_POSE, NUM_FREE),
            "free_bias": (1, NUM_FREE),
            "free_actions": (NUM_ACTIONS, NUM_FREE),
        }
        self.hypermodel = Hypermodel(config, self._shapes, context_size)
        self.scale = nn.Parameter(torch.zeros(2, 2))

        self._has_model = config.model
        if config.model:
            num_inputs += config.task_code
            num_outputs = NUM_ACTIONS + self.num_bins + 1
        else:
            num_inputs -= config.latent
            num_outputs = 1 + NUM_ACTIONS + 1
        num_inputs += NUM_TO_GOAL + self.hypermodel.num_features
        self.body = nn.Sequential(
            nn.Linear(num_inputs, config.head_hidden),
            nn.ReLU(inplace=True),
            nn.Linear(config.head_hidden, config.head_hidden),
            nn.ReLU(inplace=True),
        )
        self.heads = nn.Linear(config.head_hidden, num_outputs)
        nn.init.zeros_(self.heads.weight)
        with torch.no_grad():
            self.heads.bias[:] = 0.0
            self.heads.bias[-1] = _FIRST_GOAL
            if config.model:
                self.heads.bias[NUM_ACTIONS:-1] = -(self.support - _FIRST_VALUE).abs() / 3

    def encode(self, features: torch.Tensor) -> torch.Tensor:
        """Returns latent states `[G, K, D]` of state features `[G, K, 9]`; see `state_features`."""
        return torch.cat([features[..., :NUM_BODY], self.encoder(features[..., NUM_POSE:NUM_BODY])], dim=-1)

    def decode(self, latent: torch.Tensor) -> torch.Tensor:
        """Returns the first seven state features `[G, K, 7]` of latent states."""
        return latent[..., :NUM_BODY]

    def on_map(self, moved: torch.Tensor) -> torch.Tensor:
        """Returns displacements `[..., 2]` on the map (row, column) of those in metres (x, y)."""
        return SCALE_RATE * (moved[..., None] * self.scale).sum(-2)

    def locate(self, latent: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the estimated positions `[G, K, 2]` (row, column) of latent states on the map."""
        return code.positions[:, None, :2] + self.on_map(latent[..., :2])

    def reanchored(self, anchor: torch.Tensor, moved: torch.Tensor, start: torch.Tensor) -> torch.Tensor:
        """Returns `anchor` `[G, 2]`, shifted just enough that the estimated position lies in the `start` cell.

        The estimated position is that of a body displaced by `moved` `[G, 2]` (m) from the anchor.
        """
        position = anchor + self.on_map(moved)
        return anchor + torch.clamp(position, start - 0.5, start + 0.5) - position

    def look(self, latent: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns what is read from the context at the positions of latent states, `[G, K, W]`.

        It is a code of the estimated position, anchor and goal; then the rows and the features read there. No gradient
        reaches the position from here: what tells goals apart, in `predict`, trains it.
        """
        position = self.locate(latent, code).detach()
        table = torch.cat([code.rows, code.features], dim=-1)
        seen = read(position, table, self.hypermodel.sharpness)
        places = place_code(position, code.positions, self._size) * self.place_weights
        return torch.cat([places, seen], dim=-1)

    def generated(self, code: Code) -> dict[str, torch.Tensor]:
        """Returns the transition's weights by name, each `[G, rows, columns]`, but for the rows of cells."""
        parts = code.weights.split([rows * columns for rows, columns in self._shapes.values()], dim=-1)
        return {
            name: part.unflatten(-1, shape) for (name, shape), part in zip(self._shapes.items(), parts, strict=True)
        }

    def first_layer(self, latent: torch.Tensor, seen: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the transition's first layer without the action, `[G, K, H]`."""
        weights = self.generated(code)
        first = self._inputs(latent, seen) @ weights["inputs"] + weights["bias"]
        if code.rows.shape[-1]:
            first = first + seen[..., NUM_PLACE : NUM_PLACE + first.shape[-1]]
        return first

    def step(self, latent: torch.Tensor, first: torch.Tensor, action: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the next latent states `[G, K, D]`, from the output of `first_layer` and actions `[G, K]`."""
        weights = self.generated(code)
        chosen = functional.one_hot(action, NUM_ACTIONS).to(first.dtype)
        free = (
            latent[..., NUM_POSE:NUM_BODY] @ weights["free"] + weights["free_bias"] + chosen @ weights["free_actions"]
        )
        heading = latent[..., 2:NUM_POSE]
        # The move and the velocity of free motion, in the map's frame: [G, K, 4].
        ahead = torch.cat([_rotate(free[..., :2], heading), _rotate(free[..., 3:5], heading)], dim=-1)
        first = first + chosen @ weights["actions"] + ahead @ weights["ahead"]
        hidden = functional.relu(functional.layer_norm(first, first.shape[-1:]))
        body, motion = _moved_by(latent, free, hidden @ weights["second"] + weights["second_bias"])
        motion = functional.layer_norm(latent[..., NUM_BODY:] + motion, motion.shape[-1:])
        return torch.cat([body, motion], dim=-1)

    def predict(self, latent: torch.Tensor, seen: torch.Tensor, code: Code) -> Predictions:
        """Returns the outputs of the heads."""
        out = self._outputs(latent, seen, code)
        return Predictions(out[..., :NUM_ACTIONS], out[..., NUM_ACTIONS:-1], out[..., -1])

    def predict_without_model(self, latent: torch.Tensor, code: Code) -> tuple[torch.Tensor, torch.Tensor]:
        """Returns action values `[G, K, 6]` in steps, dueling (Wang et al. 2016), and goal logits `[G, K]`."""
        out = self._outputs(latent, self.look(latent, code), code)
        value, advantage, goal = out.split([1, NUM_ACTIONS, 1], dim=-1)
        return dueling_values(value, advantage), goal[..., 0]

    def value(self, value_logits: torch.Tensor) -> torch.Tensor:
        """Returns the means `[G, K]` of categorical values, in steps."""
        return torch.softmax(value_logits, dim=-1) @ self.support

    def _outputs(self, latent: torch.Tensor, seen: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the outputs of the heads, `[G, K, ...]`; without a model they get no learned codes."""
        to_goal = goal_code(self.locate(latent, code), code.positions[:, 2:])
        features = seen[..., NUM_PLACE + code.rows.shape[-1] :]
        if self._has_model:
            task = code.task[:, None].expand(-1, latent.shape[1], -1)
            parts = [self._inputs(latent, seen), to_goal, task, features]
        else:
            parts = [self._inputs(self.decode(latent), seen), to_goal, features]
        return self.heads(self.body(torch.cat(parts, dim=-1)))

    def _inputs(self, latent: torch.Tensor, seen: torch.Tensor) -> torch.Tensor:
        """Returns `[G, K, D + 34]`: the latent state, with 5 m as the unit of the displacement, and the places.

        Of states without the learned code, `[G, K, 7]`, it returns `[G, K, 7 + 34]`.
        """
        return torch.cat([latent[..., 2:], latent[..., :2] / DISPLACEMENT_UNIT, seen[..., :NUM_PLACE]], dim=-1)


class Hypermodel(nn.Module):
    """Generates the weights from a code of the whole context, and a row for each cell's position.

    The code reads all cells of a context of one size, or the mean over the cells of one of any size.

    At first the weights are those of an ordinary network, nearly equal for all contexts: Bias-HyperInit (Beck et al.
    2022). The rows come from convolutions, so that patterns of walls that mazes share are learned once.
    """

    def __init__(self, config: MMNConfig, shapes: dict[str, tuple[int, int]], context_size: int):
        super().__init__()
        self.encoder = MapEncoder(_CHANNELS, NEAR_DILATIONS)
        size = config.embedding
        self._is_pooled = config.any_size
        num_coded = 1 if config.any_size else context_size**2
        self.embedding = nn.Sequential(nn.Linear(_CHANNELS * num_coded, size), nn.LayerNorm(size))
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
        self.reader: nn.Module | None = None
        if config.reading:
            self.reader = WayReader(_CHANNELS) if config.far == "paths" else MapEncoder(_CHANNELS, FAR_DILATIONS)
        self.num_features = num_encoded * config.reading
        self.sharpness = nn.Parameter(torch.tensor(0.0))

    def forward(self, context: torch.Tensor, anchor: torch.Tensor, closes: bool = False) -> Code:
        """Returns the code of contexts `[G, 4, M, M]`; displacements are measured from `anchor` `[G, 2]`.

        If `closes`, cheapest ways go around cells that cost much.
        """
        encoded = self.encoder(context)
        embedding = self.embedding(encoded.mean(dim=(2, 3)) if self._is_pooled else encoded.flatten(1))
        weights = self.hyper(embedding / math.sqrt(embedding.shape[-1]))
        if self.shared is not None:  # the context's code is an input: it adds to the first layer alone
            weights = torch.cat([weights, weights.new_zeros(len(weights), len(self.shared) - weights.shape[-1])], -1)
            weights = weights + self.shared
        rows = features = context[:, :0]
        if self.rows is not None:
            rows = self.rows(torch.cat([encoded, context], dim=1))
        if self.reader is not None:
            is_way = isinstance(self.reader, WayReader)
            seen = self.reader(context, closes) if is_way else self.reader(context)
            features = torch.cat([seen, context], dim=1)
        rows, features = (planes.flatten(2).transpose(1, 2) for planes in (rows, features))
        positions = torch.cat([anchor, marked_position(context[:, GOAL])], dim=-1)
        return Code(positions, weights, rows, self.task(functional.relu(embedding)), features)


class WayReader(nn.Module):
    """Features of every cell of the map by the cheapest ways to the goal, however far it is."""

    def __init__(self, channels: int):
        """`channels` are those of the costs and of the features."""
        super().__init__()
        self.costs = cost_layers(NUM_PLANES, channels)
        self.features = nn.Conv2d(_NUM_WAY, channels, 1)

    def forward(self, context: torch.Tensor, closes: bool = False) -> torch.Tensor:
        """Returns `[G, C, M, M]` of contexts `[G, 4, M, M]`; if `closes`, ways go around cells that cost much."""
        cost = cell_costs(self.costs(context)[:, 0])
        entering = torch.where(cost > _DEAR, _CLOSING * cost, cost) if closes else cost
        way = CheapestWays.apply(entering, torch.where(context[:, GOAL] > 0, 0.0, FAR))
        # How much nearer the goal is in the eight cells around each; beyond the border, as far as beside it.
        size = way.shape[-1]
        padded = functional.pad(way[:, None], (1, 1, 1, 1), mode="replicate")[:, 0]
        around = [
            padded[:, row : row + size, column : column + size]
            for row in range(3)
            for column in range(3)
            if (row, column) != (1, 1)
        ]
        nearer = ((way[:, None] - torch.stack(around, dim=1)) / 2).clamp(-2, 2)
        scalars = torch.stack([torch.tanh(way / 5), torch.tanh(way / 40), torch.log(cost) / 3], dim=1)
        return functional.relu(self.features(torch.cat([nearer, scalars], dim=1)))


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


def _moved_by(latent: torch.Tensor, free: torch.Tensor, change: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Returns the body `[G, K, 7]` after a step, and the change of the motion's code `[G, K, D - 7]`.

    Args:
      latent: `[G, K, D]`, before the step.
      free: `[G, K, 6]`, the step in the body's frame without obstacles.
      change: `[G, K, 10 + D - 7]`, what is added to it in the body's frame, then in the map's frame, along whose axes
        walls stop the body, then to the motion's code.
    """
    heading = latent[..., 2:NUM_POSE]
    in_body, in_map, motion = change.split([NUM_FREE, NUM_STOPPED, change.shape[-1] - NUM_CHANGES], dim=-1)
    in_body = free + in_body
    moved = latent[..., :2] + _rotate(in_body[..., :2], heading) + in_map[..., :2]
    turn = torch.stack([torch.sin(in_body[..., 2]), torch.cos(in_body[..., 2])], dim=-1)
    turned = _rotate(heading.flip(-1), turn).flip(-1)
    planar = in_body[..., 3:5] + _rotate(in_map[..., 2:], heading * heading.new_tensor([-1.0, 1.0]))
    return torch.cat([moved, turned, planar, in_body[..., 5:]], dim=-1), motion


def _rotate(vector: torch.Tensor, heading: torch.Tensor) -> torch.Tensor:
    """Returns vectors `[..., 2]`, turned by the angles whose sines and cosines are `heading` `[..., 2]`."""
    (x, y), (sine, cosine) = vector.unbind(-1), heading.unbind(-1)
    return torch.stack([cosine * x - sine * y, sine * x + cosine * y], dim=-1)
