"""The network of MMN: a row of generated weights for each cell of the map, and distances propagated over the map.

`G` is the number of contexts, `K` of latent states in each, `M` the side of the context, `H` the size of the
transition's hidden layer, `P` the number of propagated distances, `T` of features of a cell.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import torch
from torch import nn
from torch.nn import functional

from ..common.layers import NUM_PLANES, NUM_WAVES, MapEncoder, steepness, waves
from .compiled import spatial as compiled
from .compiled.model import CompiledModel
from .compiled.parts import Contexts, Linear, layer_of, linear_of
from .config import MMNConfig
from .network import (
    NUM_ACTIONS,
    NUM_BODY,
    NUM_CHANGES,
    NUM_FREE,
    NUM_POSE,
    NUM_STOPPED,
    Network,
    Predictions,
    Roots,
    ahead_of,
    marked_positions,
    moved_by,
)
from .reading import read

_DILATIONS = (1, 1, 1)  # of the map's convolutions
_FIRST_COST = 2.0  # steps a cell, before anything is learned
_BARRED = 100.0  # steps to enter a wall: longer than any detour
_FAR = 1000.0  # steps; farther than any path
_NUM_UNUSED = 1  # of the heads' outputs, which the shipped checkpoint has


class Code(NamedTuple):
    """The output of the hypermodel for a context."""

    positions: torch.Tensor  # [G, 4], anchor and goal on the map, each (row, column)
    weights: torch.Tensor  # [G, M * M, H + T], of each cell: a row of the first layer's, features for the heads
    distance: torch.Tensor  # [G, P, M, M], learned steps to the goal
    enterable: torch.Tensor  # [G, 1, M, M], logits that cells can be entered


class MMNNetwork(Network):
    """Reads weights and features of the map at the estimated position.

    A step adds a change that is linear in the body's own frame, as free motion is, and the output of the transition
    network: a change in that frame, and one in the map's frame, along whose axes walls stop the body.
    """

    hypermodel: SpatialHypermodel
    serves_any_size = True

    def __init__(self, config: MMNConfig, context_size: int):
        super().__init__(config, context_size)
        num_inputs = NUM_BODY - 2 + config.latent + NUM_WAVES
        self.hypermodel = SpatialHypermodel(config, num_inputs, NUM_CHANGES + config.latent)
        self.scale = nn.Parameter(torch.zeros(2, 2))
        self.free = nn.Linear(NUM_BODY - NUM_POSE, NUM_FREE)
        self.free_by_action = nn.Embedding(NUM_ACTIONS, NUM_FREE)
        nn.init.zeros_(self.free_by_action.weight)
        self.ahead = nn.Linear(NUM_STOPPED, config.hidden)
        self.normalize = nn.LayerNorm(config.latent)
        num_outputs = NUM_ACTIONS + self.num_bins + 1 + _NUM_UNUSED
        self._make_heads(num_inputs + 2 + self.hypermodel.num_features, num_outputs, config)
        self._weights = {name: getattr(config, f"{name}_weight") for name in ("localization", "distance", "visit")}

    def look(self, latent: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns rows of weights and features, interpolated."""
        return read(self.locate(latent, code), code.weights, self.hypermodel.sharpness)

    def first_layer(self, latent: torch.Tensor, seen: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the learned layer plus the generated rows."""
        generated = seen[..., : -self.hypermodel.num_features]
        return self.hypermodel.transition.inputs(self._inputs(latent)) + generated

    def step(self, latent: torch.Tensor, first: torch.Tensor, action: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the next latent states."""
        free = self.free(latent[..., NUM_POSE:NUM_BODY]) + self.free_by_action(action)
        first = first + self.ahead(ahead_of(free, latent))
        body, motion = moved_by(latent, free, self.hypermodel.transition(first, action))
        return torch.cat([body, self.normalize(latent[..., NUM_BODY:] + motion)], dim=-1)

    def predict(self, latent: torch.Tensor, seen: torch.Tensor, code: Code) -> Predictions:
        """Returns the outputs of the heads."""
        to_goal = (code.positions[:, None, 2:] - self.locate(latent, code)) / 10
        features = seen[..., -self.hypermodel.num_features :]
        out = self.heads(self.body(torch.cat([self._inputs(latent), to_goal, features], dim=-1)))
        return Predictions(out[..., :NUM_ACTIONS], out[..., NUM_ACTIONS:-2], out[..., -2])

    def extra_losses(self, roots: Roots, code: Code) -> Iterator[tuple[str, torch.Tensor, torch.Tensor]]:
        """Yields the losses beyond the paper.

        The estimated position is compared with the true cell, propagated distances with values, and enterable cells
        with those visited in this maze.
        """
        position = self.locate(roots.latent, code)
        error = (position - roots.position).abs().mean(dim=-1)
        yield "localization_loss", self._weights["localization"] * error, roots.exists
        distances = code.distance.flatten(2).transpose(1, 2)
        distance = read(position.detach(), distances, self.hypermodel.sharpness)  # [G, K, P]
        error = functional.smooth_l1_loss(distance, -roots.value[..., None].expand_as(distance), reduction="none")
        yield "distance_loss", self._weights["distance"] * error.mean(dim=-1), roots.going
        error = functional.binary_cross_entropy_with_logits(code.enterable, roots.visited, reduction="none")
        yield "visit_loss", self._weights["visit"] * error, torch.ones_like(error)

    def compiled(self, code: Code, num_roots: int) -> CompiledModel:
        """Returns the model as kernels, with the weights as they are now."""
        transition: Any = self.hypermodel.transition
        model = compiled.SpatialModel(
            Contexts(code.positions.numpy(), code.weights.numpy(), num_roots),
            self.num_bins,
            self.scale.detach().numpy(),
            steepness(self.hypermodel.sharpness.detach()).reshape(1).numpy(),
            linear_of(self.free),
            self.free_by_action.weight.detach().numpy(),
            linear_of(self.ahead),
            layer_of(transition.inputs.weight, transition.inputs.bias),
            transition.actions.weight.detach().numpy(),
            layer_of(transition.later[0].weight, transition.later[0].bias),
            layer_of(transition.later[2].weight, transition.later[2].bias),
            Linear(self.normalize.weight.detach().numpy()[None], self.normalize.bias.detach().numpy()),
            self._compiled_heads(),
        )
        return CompiledModel(model, self.ahead.out_features, compiled.step, compiled.arrive)

    def _inputs(self, latent: torch.Tensor) -> torch.Tensor:
        """Returns `[G, K, D + 14]`: heading, velocities, the code of the motion, and waves of the displacement."""
        return torch.cat([latent[..., 2:], waves(latent[..., :2])], dim=-1)


class SpatialHypermodel(nn.Module):
    """Generates a row of weights for each cell, for contexts of any size."""

    def __init__(self, config: MMNConfig, num_inputs: int, num_outputs: int):
        super().__init__()
        self.encoder = MapEncoder(config.channels, _DILATIONS)
        num_encoded = config.channels + NUM_PLANES
        self.rows = nn.Conv2d(num_encoded, config.hidden, 1)
        self.propagation = Propagation(num_encoded, config.num_distances)
        self.num_features = num_encoded + 5 * config.num_distances
        self.sharpness = nn.Parameter(torch.tensor(0.0))
        self.transition = _Transition(num_inputs, config.hidden, num_outputs)

    def forward(self, context: torch.Tensor, anchor: torch.Tensor | None = None) -> Code:
        """Returns the code of contexts `[G, 4, M, M]`.

        Displacements are measured from `anchor` `[G, 2]`, a position (row, column), by default the marked start.
        """
        features = torch.cat([self.encoder(context), context], dim=1)
        rows = self.rows(features)  # [G, H, M, M]
        distance, enterable = self.propagation(features, context[:, 2:3])
        features = torch.cat([features, self.propagation.slopes(distance)], dim=1)
        table = torch.cat([rows, features], dim=1).flatten(2).transpose(1, 2)  # [G, M * M, H + T]
        return Code(marked_positions(context, anchor), table, distance, enterable)


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
    """The learned layers of a transition; the hypermodel adds to the first one."""

    def __init__(self, num_inputs: int, hidden: int, num_outputs: int):
        super().__init__()
        self.inputs = nn.Linear(num_inputs, hidden)
        self.actions = nn.Embedding(NUM_ACTIONS, hidden)
        nn.init.normal_(self.actions.weight, std=0.3)  # like the other terms of the first layer
        self.later = nn.Sequential(nn.Linear(hidden, hidden), nn.ReLU(inplace=True), nn.Linear(hidden, num_outputs))

    def forward(self, first: torch.Tensor, action: torch.Tensor) -> torch.Tensor:
        return self.later(functional.relu(first + self.actions(action), inplace=True))
