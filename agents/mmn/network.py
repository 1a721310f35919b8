"""The networks of MMN: an encoder of states, a hypermodel of contexts, a latent transition, and heads.

`G` is the number of contexts, `K` of latent states in each, `D` the size of a latent state.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import nn

from ..layers import NUM_WAVES, waves
from .config import MMNConfig
from .hypermodels import HYPERMODELS, NUM_ACTIONS, Code, Hypermodel

NUM_BODY_FEATURES = 5  # sine and cosine of yaw, velocities forward, left and of yaw
_SCALE_RATE = 5.0  # how much faster the map's scale is learned than weights of order one tenth are
_RARE = -4.0  # logit of being in the goal, before anything is learned


class Predictions(NamedTuple):
    """What the heads say of latent states."""

    policy_logits: torch.Tensor  # [G, K, 6]
    value_logits: torch.Tensor  # [G, K, bins], of whole values from 1 - bins to 0
    goal_logit: torch.Tensor  # [G, K], of being in the goal cell, which ends the episode
    reward_logit: torch.Tensor  # [G, K], of a reward of 0, not -1, on arriving


class MMNNetwork(nn.Module):
    """The paper's e (`encode`), h (`hypermodel`), f (`first_layer`, then `step`) and g (`predict`).

    A latent state is two metres moved since the context was new, and a code of the body's motion. Where that is on the
    map, is learned: the start plus a learned linear map of what was moved.
    """

    support: torch.Tensor  # [bins], the values that a categorical value weighs

    def __init__(self, config: MMNConfig, context_size: int):
        super().__init__()
        self.latent_size = 2 + config.latent
        self.encoder = nn.Sequential(
            nn.Linear(NUM_BODY_FEATURES, config.hidden),
            nn.ReLU(inplace=True),
            nn.Linear(config.hidden, config.latent),
            nn.LayerNorm(config.latent),
        )
        make_hypermodel = HYPERMODELS[config.hypermodel]
        self.hypermodel: Hypermodel = make_hypermodel(config, config.latent + NUM_WAVES, self.latent_size, context_size)
        self.scale = nn.Parameter(torch.zeros(2, 2))
        self.normalize = nn.LayerNorm(config.latent)
        self.decoder = nn.Linear(config.latent, NUM_BODY_FEATURES)
        self.num_bins = config.longest_value + 1
        num_inputs = config.latent + NUM_WAVES + 2 + self.hypermodel.num_task_features
        self.body = nn.Sequential(
            nn.Linear(num_inputs, config.head_hidden),
            nn.ReLU(inplace=True),
            nn.Linear(config.head_hidden, config.head_hidden),
            nn.ReLU(inplace=True),
        )
        self.heads = nn.Linear(config.head_hidden, NUM_ACTIONS + self.num_bins + 2)
        self.register_buffer("support", torch.arange(-config.longest_value, 1.0), persistent=False)
        nn.init.zeros_(self.heads.weight)
        nn.init.zeros_(self.heads.bias)
        nn.init.constant_(self.heads.bias[-2:], _RARE)

    def encode(self, features: torch.Tensor) -> torch.Tensor:
        """Latent states `[G, K, D]` of state features `[G, K, 9]`; see `state_features`."""
        return torch.cat([features[..., :2], self.encoder(features[..., 2:7])], dim=-1)

    def decode(self, latent: torch.Tensor) -> torch.Tensor:
        """`[G, K, 7]`: the first seven state features, back from latent states."""
        return torch.cat([latent[..., :2], self.decoder(latent[..., 2:])], dim=-1)

    def locate(self, latent: torch.Tensor, code: Code) -> torch.Tensor:
        """`[G, K, 2]`: where on the map, (row, column), latent states are believed to be."""
        return code.places[:, None, :2] + _SCALE_RATE * (latent[..., :2, None] * self.scale).sum(-2)

    def look(self, latent: torch.Tensor, code: Code) -> torch.Tensor:
        """`[G, K, W]`: what latent states see of their context, there."""
        return self.hypermodel.look(self.locate(latent, code), code)

    def first_layer(self, latent: torch.Tensor, seen: torch.Tensor, code: Code) -> torch.Tensor:
        """`[G, K, H]`: the transition's first layer, but for the action."""
        return self.hypermodel.first_layer(self._body(latent), seen, code)

    def step(self, latent: torch.Tensor, first: torch.Tensor, action: torch.Tensor, code: Code) -> torch.Tensor:
        """`[G, K, D]`: the next latent states, from what `first_layer` gave and actions `[G, K]`."""
        change = self.hypermodel.later_layers(first, action, code)
        return torch.cat([latent[..., :2] + change[..., :2], self.normalize(latent[..., 2:] + change[..., 2:])], dim=-1)

    def step_all(self, latent: torch.Tensor, first: torch.Tensor, code: Code) -> torch.Tensor:
        """`[G, 6 K, D]`: the next latent states of every action, those of one state side by side."""
        num_states = latent.shape[1]
        action = torch.arange(NUM_ACTIONS, device=latent.device).repeat(num_states).expand(len(latent), -1)
        latent, first = (values.repeat_interleave(NUM_ACTIONS, dim=1) for values in (latent, first))
        return self.step(latent, first, action, code)

    def predict(self, latent: torch.Tensor, seen: torch.Tensor, code: Code) -> Predictions:
        """What the heads say."""
        to_goal = (code.places[:, None, 2:] - self.locate(latent, code)) / 10
        inputs = torch.cat([self._body(latent), to_goal, self.hypermodel.task_features(seen, code)], dim=-1)
        out = self.heads(self.body(inputs))
        return Predictions(out[..., :NUM_ACTIONS], out[..., NUM_ACTIONS:-2], out[..., -2], out[..., -1])

    def value(self, value_logits: torch.Tensor) -> torch.Tensor:
        """`[G, K]`: means of categorical values, in steps."""
        return torch.softmax(value_logits, dim=-1) @ self.support

    def _body(self, latent: torch.Tensor) -> torch.Tensor:
        """`[G, K, D + 14]`: the body's motion, and where in a cell it is."""
        return torch.cat([latent[..., 2:], waves(latent[..., :2])], dim=-1)
