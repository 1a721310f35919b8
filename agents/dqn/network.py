"""The Q-network: convolutions over the map, read where the agent believes to be, joined with its state.

`G` is the number of contexts, `K` of states in each, `M` the side of the context, `C` of channels.
"""

from __future__ import annotations

import math

import torch
from torch import nn
from torch.nn import functional

NUM_PLANES = 4
NUM_STATE_FEATURES = 7
NUM_ACTIONS = 6
# Dilations of the 3 x 3 convolutions: the last one sees 19 cells far, across a 13 x 13 map.
_DILATIONS = (1, 1, 2, 2, 4, 4, 2, 1, 1)
_FREQUENCIES = (0.25, 0.5, 1.0, 2.0)  # per metre; octaves in which what was moved is given
_SCALE_RATE = 5.0  # how much faster the scale is learned than weights of order one tenth are
_VALUE_SCALE = 10.0  # steps; outputs of order one then span the values that matter


class MapEncoder(nn.Module):
    """Features of every cell of the map, each of which knows of walls and goal far around it."""

    def __init__(self, channels: int):
        super().__init__()
        self.inputs = nn.Conv2d(NUM_PLANES, channels, 3, padding=1)
        self.layers = nn.ModuleList(
            nn.Conv2d(channels, channels, 3, padding=dilation, dilation=dilation) for dilation in _DILATIONS
        )

    def forward(self, context: torch.Tensor) -> torch.Tensor:
        """`[G, C, M, M]` from `[G, 4, M, M]`."""
        features = functional.relu(self.inputs(context))
        for layer in self.layers:
            features = features + functional.relu(layer(features))
        return features


class QNetwork(nn.Module):
    """Dueling action values (Wang et al. 2016); with `channels` 0 of the state alone, without any context."""

    def __init__(self, channels: int, hidden: int):
        super().__init__()
        self.channels = channels
        num_inputs = NUM_STATE_FEATURES
        if channels:
            self.encoder = MapEncoder(channels)
            # Where the agent is on the map, in cells: the start, and what it moved since times a learned scale.
            self.scale = nn.Parameter(torch.zeros(2, 2))
            self.sharpness = nn.Parameter(torch.tensor(0.0))
            num_inputs += channels + 2 + 4 * len(_FREQUENCIES)
        self.body = nn.Sequential(nn.Linear(num_inputs, hidden), nn.ReLU(), nn.Linear(hidden, hidden), nn.ReLU())
        self.value = nn.Linear(hidden, 1)
        self.advantage = nn.Linear(hidden, NUM_ACTIONS)

    def encode(self, context: torch.Tensor) -> torch.Tensor:
        """What a context gives to all states: `[G, C + 4, M * M]`, features of the map, places of start and goal."""
        planes = self.encoder(context).flatten(2)
        places = [marked_place(context[:, plane]) for plane in (3, 2)]  # start, goal
        size = planes.shape[-1]
        return torch.cat([planes, torch.cat(places, dim=-1)[:, :, None].expand(-1, -1, size)], dim=1)

    def forward(self, state: torch.Tensor, code: torch.Tensor | None = None) -> torch.Tensor:
        """Action values `[G, K, 6]` of states `[G, K, 9]` (see `state_features`) in contexts encoded as `code`."""
        features = state[..., 2:]
        if self.channels:
            assert code is not None
            features = torch.cat([features, self.read(state[..., :2], code)], dim=-1)
        hidden = self.body(features)
        advantage = self.advantage(hidden)
        return _VALUE_SCALE * (self.value(hidden) + advantage - advantage.mean(dim=-1, keepdim=True))

    def locate(self, moved: torch.Tensor, code: torch.Tensor) -> torch.Tensor:
        """`[G, K, 2]`: where on the map, (row, column), the agent believes to be after having `moved` (x, y) metres."""
        start = code[:, self.channels : self.channels + 2, 0]
        return start[:, None] + _SCALE_RATE * (moved @ self.scale)

    def read(self, moved: torch.Tensor, code: torch.Tensor) -> torch.Tensor:
        """`[G, K, C + 18]`: the map's features around the agent, the way to the goal, and what was moved, in waves."""
        place = self.locate(moved, code)
        size = math.isqrt(code.shape[-1])
        cells = torch.arange(size, device=code.device)
        distance = (place[..., None] - cells) ** 2  # [G, K, 2, M]
        weight = torch.softmax(-distance * functional.softplus(self.sharpness + 1.0), dim=-1)
        # A soft one-hot of the row times one of the column: [G, K, M * M]
        where = (weight[..., 0, :, None] * weight[..., 1, None, :]).flatten(2)
        local = where @ code[:, : self.channels].transpose(1, 2)
        to_goal = (code[:, self.channels + 2 :, 0][:, None] - place) / 10.0
        phase = 2 * math.pi * moved[..., None] * torch.tensor(_FREQUENCIES, device=moved.device)
        waves = torch.cat([torch.sin(phase), torch.cos(phase)], dim=-1).flatten(-2)
        return torch.cat([local, to_goal, waves], dim=-1)


def marked_place(plane: torch.Tensor) -> torch.Tensor:
    """`[G, 2]` float: row and column of the mark in one-hot planes `[G, M, M]`."""
    size = plane.shape[-1]
    index = plane.flatten(1).argmax(dim=1)
    return torch.stack([index // size, index % size], dim=-1).to(plane.dtype)


def state_features(state: torch.Tensor, origin: torch.Tensor) -> torch.Tensor:
    """`[..., 9]`: x, y since `origin` `[..., 2]` (m), sine and cosine of yaw, three velocities, a fifth of x and y.

    Of the twelve numbers of a state, only these vary: see docs/tasks.md.
    """
    yaw = state[..., 5]
    return torch.cat(
        [
            state[..., :2] - origin,
            torch.sin(yaw)[..., None],
            torch.cos(yaw)[..., None],
            state[..., 6:8] / 3.2,
            state[..., 11:12] / 2.3,
            (state[..., :2] - origin) / 5.0,
        ],
        dim=-1,
    )
