"""The network of the belief planner: features of each cell of the map, and distances propagated over the map.

Its hypermodel reads no map but a belief over the map (`belief.Belief`).

`G` is the number of contexts, `K` of latent states in each, `M` the side of the context, `H` the size of the
transition's hidden layer, `P` the number of propagated distances, `T` of features of a cell.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from ..common.layers import NUM_WAVES, MapEncoder, marked_position, waves
from ..muzero.network import (
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
    moved_by,
    rotate,
)
from ..muzero.reading import read
from .belief import GOAL, NUM_PLANES, WALL, Belief
from .config import BeliefPlannerConfig
from .shortest_paths import cheapest_paths

_DILATIONS = (1, 1, 1)  # of the map's convolutions
_FIRST_COST = 2.0  # steps a cell, before anything is learned
_DETOUR = 12.0  # steps that a failed try costs
_BARRED = 1e4  # steps to enter a wall, at most: longer than any detour
_FAR = 1e5  # steps; farther than any path
REACH = 30.0  # steps; how far goals are in training, and no farther than values are learned well
_NEAR = 10.0  # steps; how far a goal that is brought nearer seems to be, at least
_LONGEST = 100.0  # steps; longer distances count as this in the loss
_LEAST_FREE = 0.1  # share of free cells around a position


class Code(NamedTuple):
    """The output of the hypermodel for a context."""

    positions: torch.Tensor  # [G, 4], anchor and goal on the map, each (row, column)
    weights: torch.Tensor  # [G, M * M, H + T], of each cell: a row of the first layer's, features for the heads. The
    # last ones are the ways to the goal, if the cell is free, and whether it is
    distance: torch.Tensor  # [G, P, M, M], learned steps to the goal
    free: torch.Tensor  # [G, 1, M, M], 1 where a cell is probably free


class BeliefPlannerNetwork(Network):
    """Reads weights and features of the map at the estimated position.

    The agent acts by `belief`, `hypermodel`, `encode`, `look`, `predict`, `velocity` and `wished`. The rest is for
    learning: the model's `step`, and losses. What the hypermodel makes of a map is a table by cell, no network.

    A step adds a change that is linear in the body's own frame, as free motion is, and the output of the transition
    network: a change in that frame, and one in the map's frame, along whose axes walls stop the body.
    """

    hypermodel: Hypermodel

    def __init__(self, config: BeliefPlannerConfig):
        super().__init__(config)
        num_inputs = NUM_BODY - 2 + config.latent + NUM_WAVES
        self.hypermodel = Hypermodel(config, num_inputs, NUM_CHANGES + config.latent)
        self.scale = nn.Parameter(torch.zeros(2, 2))
        self.free = nn.Linear(NUM_BODY - NUM_POSE, NUM_FREE)
        self.free_by_action = nn.Embedding(NUM_ACTIONS, NUM_FREE)
        nn.init.zeros_(self.free_by_action.weight)
        self.ahead = nn.Linear(NUM_STOPPED, config.hidden)
        self.normalize = nn.LayerNorm(config.latent)
        num_outputs = NUM_ACTIONS + self.num_bins + 1
        self._make_heads(num_inputs + 2 + self.hypermodel.num_features, num_outputs, config)
        self.belief = Belief(config.belief_channels)
        self._belief_rate, self._scale_updates = config.belief_rate, config.scale_updates
        self._weights = {name: getattr(config, f"{name}_weight") for name in ("localization", "distance")}

    def parameter_groups(self) -> list[dict[str, Any]]:
        """Returns groups of their own for the belief and for the map's scale."""
        of_belief = list(self.belief.parameters())
        others = [parameter for name, parameter in self.named_parameters() if not name.startswith(("belief.", "scale"))]
        return [
            {"params": others, "rate": 1.0},
            {"params": of_belief, "rate": self._belief_rate},
            {"params": [self.scale], "rate": 1.0, "constant_updates": self._scale_updates},
        ]

    def metre(self) -> np.ndarray:
        """Returns rows and columns (first axis) on the map of a metre in x and in y (second axis): `[2, 2]` float32."""
        return np.ascontiguousarray(self.on_map(torch.eye(2, device=self.scale.device)).detach().cpu().numpy().T)

    def velocity(self, features: torch.Tensor) -> torch.Tensor:
        """Returns the velocities `[..., 2]` on the map of states with features `[..., 9]`, of a top speed of 1."""
        return self.on_map(rotate(features[..., NUM_POSE:6], features[..., 2:NUM_POSE]))

    def wished(self, features: torch.Tensor, action: torch.Tensor) -> torch.Tensor:
        """Returns the velocities `[..., 2]` on the map after free motion, of a top speed of 1.

        Args:
          features: `[..., 9]`, of the states before the actions.
          action: `[...]`.
        """
        free = self.free(features[..., NUM_POSE:NUM_BODY]) + self.free_by_action(action)
        return self.on_map(rotate(free[..., 3:5], features[..., 2:NUM_POSE]))

    def look(self, latent: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns rows of weights and features, interpolated; ways are those of the free cells around."""
        seen = read(self.locate(latent, code), code.weights, self.hypermodel.sharpness)
        rest, ways, free = seen.split([seen.shape[-1] - self.hypermodel.num_ways - 1, self.hypermodel.num_ways, 1], -1)
        return torch.cat([rest, ways / free.clamp(min=_LEAST_FREE), free], dim=-1)

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
        return Predictions(out[..., :NUM_ACTIONS], out[..., NUM_ACTIONS:-1], out[..., -1])

    def extra_losses(self, roots: Roots, code: Code) -> Iterator[tuple[str, torch.Tensor, torch.Tensor]]:
        """Yields the losses beyond the paper: of the estimated position, and of propagated distances against values."""
        position = self.locate(roots.latent, code)
        error = (position - roots.position).abs().mean(dim=-1)
        yield "localization_loss", self._weights["localization"] * error, roots.exists
        # Of the cells around a position, those count that the body can be in.
        distances = torch.cat([code.free * code.distance.clamp(max=_LONGEST), code.free], dim=1)
        near = read(position.detach(), distances.flatten(2).transpose(1, 2), self.hypermodel.sharpness)
        distance = near[..., :-1] / near[..., -1:].clamp(min=_LEAST_FREE)  # [G, K, P]
        error = functional.smooth_l1_loss(distance, -roots.value[..., None].expand_as(distance), reduction="none")
        yield "distance_loss", self._weights["distance"] * error.mean(dim=-1), roots.going

    def _inputs(self, latent: torch.Tensor) -> torch.Tensor:
        """Returns `[G, K, D + 14]`: heading, velocities, the code of the motion, and waves of the displacement."""
        return torch.cat([latent[..., 2:], waves(latent[..., :2])], dim=-1)


class Hypermodel(nn.Module):
    """Generates a row of weights for each cell, for beliefs of any size."""

    def __init__(self, config: BeliefPlannerConfig, num_inputs: int, num_outputs: int):
        super().__init__()
        self.encoder = MapEncoder(config.channels, _DILATIONS, NUM_PLANES)
        num_encoded = config.channels + NUM_PLANES
        self.rows = nn.Conv2d(num_encoded, config.hidden, 1)
        self.propagation = Propagation(num_encoded, config.num_distances)
        self.num_ways = 5 * config.num_distances
        self.num_features = num_encoded + self.num_ways + 1
        self.sharpness = nn.Parameter(torch.tensor(0.0))
        self.transition = _Transition(num_inputs, config.hidden, num_outputs)

    def forward(self, belief: torch.Tensor, anchor: torch.Tensor, position: torch.Tensor | None = None) -> Code:
        """Returns the code of beliefs `[G, 2, M, M]`.

        Args:
          belief: see `belief.probabilities`.
          anchor: `[G, 2]`, the position (row, column) from which displacements are measured.
          position: `[G, 2]`, the body's, in acting: goals that are farther from it than those of training are brought
            nearer.
        """
        likely = most_likely(belief)
        features = torch.cat([self.encoder(likely), likely], dim=1)
        rows = self.rows(features)  # [G, H, M, M]
        distance = self.propagation(features, belief)
        own = distance if position is None else brought_nearer(distance, position)
        free = 1 - likely[:, WALL : WALL + 1]
        ways = torch.cat([self.propagation.slopes(distance), (own / 30).clamp(max=4)], dim=1)
        features = torch.cat([features, free * ways, free], dim=1)
        table = torch.cat([rows, features], dim=1).flatten(2).transpose(1, 2)  # [G, M * M, H + T]
        goal = marked_position(belief[:, GOAL])
        return Code(torch.cat([anchor, goal], dim=-1), table, distance, free)


class Propagation(nn.Module):
    """Distances to the goal on a map whose costs are learned: shortest paths.

    Value propagation (Nardelli et al. 2019, MVProp), with sums of costs instead of products of discounts. The cost to
    leave a cell is learned through the resulting distances. A cell that may be wall costs a detour for each failed try
    that is expected before it is entered: the odds that it is wall. So does ending at a cell in which the goal may be.
    """

    def __init__(self, num_features: int, num_distances: int):
        super().__init__()
        self.cost = nn.Conv2d(num_features, num_distances, 1)

    def forward(self, features: torch.Tensor, belief: torch.Tensor) -> torch.Tensor:
        """Returns distances `[G, P, M, M]`, from features `[G, C, M, M]` of beliefs `[G, 2, M, M]`."""
        wall, goal = belief[:, WALL : WALL + 1], belief[:, GOAL : GOAL + 1]
        cost = functional.softplus(_FIRST_COST + self.cost(features)) + _failed_tries(1 - wall, _BARRED)
        begin = _failed_tries(goal, _FAR).expand_as(cost)
        return cheapest_paths(cost.flatten(0, 1), begin.flatten(0, 1)).unflatten(0, cost.shape[:2])

    @staticmethod
    def slopes(distance: torch.Tensor) -> torch.Tensor:
        """Returns `[G, 4 P, M, M]`: the neighbours' distances minus a cell's own, of order one."""
        padded = functional.pad(distance, (1, 1, 1, 1), value=_FAR)
        neighbours = (padded[..., :-2, 1:-1], padded[..., 2:, 1:-1], padded[..., 1:-1, :-2], padded[..., 1:-1, 2:])
        return torch.cat([((neighbour - distance) / 3).clamp(-2, 2) for neighbour in neighbours], dim=1)


def most_likely(belief: torch.Tensor) -> torch.Tensor:
    """Returns the most probable maze and goal of beliefs `[G, 2, M, M]`, as ones and zeros."""
    return torch.stack([belief[:, WALL] > 0.5, belief[:, GOAL] == 1], dim=1).to(belief.dtype)


def distance_at(position: torch.Tensor, distance: torch.Tensor) -> torch.Tensor:
    """Returns the distances `[G, P]` of the cells at positions `[G, 2]`, of those of all cells `[G, P, M, M]`."""
    row, column = position.round().clamp(0, distance.shape[-1] - 1).long().unbind(-1)
    return distance[torch.arange(len(distance), device=distance.device), :, row, column]


def brought_nearer(distance: torch.Tensor, position: torch.Tensor) -> torch.Tensor:
    """Returns distances `[G, P, M, M]`, less by what is too far from `position` `[G, 2]` to the goal."""
    excess = (distance_at(position, distance) - REACH).clamp(min=0)[..., None, None]
    return torch.where(excess > 0, (distance - excess).clamp(min=_NEAR), distance)


def _failed_tries(chance: torch.Tensor, most: float) -> torch.Tensor:
    """Returns the steps that are expected to be lost, at most `most`, until one of several tries succeeds."""
    return (_DETOUR * (1 - chance) / chance.clamp(min=1e-6)).clamp(max=most)


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
