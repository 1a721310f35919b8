"""The networks of MMN: an encoder of states, a hypermodel of contexts, a latent transition, and heads.

`G` is the number of contexts, `K` of latent states in each, `D` the size of a latent state.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import nn

from ..common.layers import NUM_WAVES, waves
from .config import MMNConfig
from .hypermodels import HYPERMODELS, NUM_ACTIONS, Code, Hypermodel

_NUM_POSE = 4  # x and y moved, sine and cosine of yaw: the first numbers of a latent state, as of state features
_NUM_BODY = 7  # and velocities forward, left and of yaw
_NUM_FREE = 6  # of a step in the body's frame: a move, a turn, velocities forward, left and of yaw
_NUM_STOPPED = 4  # in the map's: a move, velocities
_NUM_CHANGES = _NUM_FREE + _NUM_STOPPED
_SCALE_RATE = 5.0  # the scale's parameters are multiplied by it, so that they are of the order of other weights
_RARE = -4.0  # logit of being in the goal, before anything is learned


class Predictions(NamedTuple):
    """The outputs of the heads for latent states."""

    policy_logits: torch.Tensor  # [G, K, 6]
    value_logits: torch.Tensor  # [G, K, bins], of whole values from 1 - bins to 0
    goal_logit: torch.Tensor  # [G, K], of being in the goal cell, which ends the episode
    reward_logit: torch.Tensor  # [G, K], of a reward of 0, not -1, on arriving


class MMNNetwork(nn.Module):
    """The paper's e (`encode`), h (`hypermodel`), f (`first_layer`, then `step`) and g (`predict`).

    A latent state holds the displacement from an anchor (m), heading, velocities and a learned code of the motion. A
    step adds a change that is linear in the body's own frame, as free motion is, and the output of the transition
    network: a change in that frame, and one in the map's frame, along whose axes walls stop the body. The estimated
    position on the map is the anchor plus a learned linear map of the displacement.
    """

    support: torch.Tensor  # [bins], the values that a categorical value weighs

    def __init__(self, config: MMNConfig, context_size: int):
        super().__init__()
        self.latent_size = _NUM_BODY + config.latent
        self.encoder = nn.Sequential(
            nn.Linear(_NUM_BODY - _NUM_POSE, config.hidden),
            nn.ReLU(inplace=True),
            nn.Linear(config.hidden, config.latent),
            nn.LayerNorm(config.latent),
        )
        make_hypermodel = HYPERMODELS[config.hypermodel]
        num_inputs = _NUM_BODY - 2 + config.latent + NUM_WAVES
        num_changes = _NUM_CHANGES + config.latent
        self.hypermodel: Hypermodel = make_hypermodel(config, num_inputs, num_changes, context_size)
        self.scale = nn.Parameter(torch.zeros(2, 2))
        self.free = nn.Linear(_NUM_BODY - _NUM_POSE, _NUM_FREE)
        self.free_by_action = nn.Embedding(NUM_ACTIONS, _NUM_FREE)
        nn.init.zeros_(self.free_by_action.weight)
        self.ahead = nn.Linear(_NUM_STOPPED, self.hypermodel.hidden)
        self.normalize = nn.LayerNorm(config.latent)
        self.num_bins = config.longest_value + 1
        self.body = nn.Sequential(
            nn.Linear(num_inputs + 2 + self.hypermodel.num_task_features, config.head_hidden),
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
        """Returns latent states `[G, K, D]` of state features `[G, K, 9]`; see `state_features`."""
        return torch.cat([features[..., :_NUM_BODY], self.encoder(features[..., _NUM_POSE:_NUM_BODY])], dim=-1)

    def decode(self, latent: torch.Tensor) -> torch.Tensor:
        """Returns the first seven state features `[G, K, 7]` of latent states."""
        return latent[..., :_NUM_BODY]

    def locate(self, latent: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the estimated positions `[G, K, 2]` (row, column) of latent states on the map."""
        return code.positions[:, None, :2] + self._displacement(latent[..., :2])

    def reanchored(self, anchor: torch.Tensor, moved: torch.Tensor, start: torch.Tensor) -> torch.Tensor:
        """Returns `anchor` `[G, 2]`, shifted just enough that the estimated position lies in the `start` cell.

        The estimated position is that of a body displaced by `moved` `[G, 2]` (m) from the anchor.
        """
        position = anchor + self._displacement(moved)
        return anchor + torch.clamp(position, start - 0.5, start + 0.5) - position

    def look(self, latent: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns what the hypermodel reads from the context at the positions of latent states, `[G, K, W]`."""
        return self.hypermodel.look(self.locate(latent, code), code)

    def first_layer(self, latent: torch.Tensor, seen: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the transition's first layer without the action, `[G, K, H]`."""
        return self.hypermodel.first_layer(self._body(latent), seen, code)

    def step(self, latent: torch.Tensor, first: torch.Tensor, action: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the next latent states `[G, K, D]`, from the output of `first_layer` and actions `[G, K]`."""
        heading, velocities = latent[..., 2:_NUM_POSE], latent[..., _NUM_POSE:_NUM_BODY]
        free = self.free(velocities) + self.free_by_action(action)
        ahead = torch.cat([rotate(free[..., :2], heading), rotate(free[..., 3:5], heading)], dim=-1)
        change = self.hypermodel.later_layers(first + self.ahead(ahead), action, code)
        in_body, in_map, motion = change.split([_NUM_FREE, _NUM_STOPPED, change.shape[-1] - _NUM_CHANGES], dim=-1)
        in_body = free + in_body
        moved = latent[..., :2] + rotate(in_body[..., :2], heading) + in_map[..., :2]
        turn = torch.stack([torch.sin(in_body[..., 2]), torch.cos(in_body[..., 2])], dim=-1)
        turned = rotate(heading.flip(-1), turn).flip(-1)
        planar = in_body[..., 3:5] + rotate(in_map[..., 2:], heading * heading.new_tensor([-1.0, 1.0]))
        motion = self.normalize(latent[..., _NUM_BODY:] + motion)
        return torch.cat([moved, turned, planar, in_body[..., 5:], motion], dim=-1)

    def step_all(self, latent: torch.Tensor, first: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the next latent states `[G, 6 K, D]` of every action; those of one state are neighbours."""
        num_states = latent.shape[1]
        action = torch.arange(NUM_ACTIONS, device=latent.device).repeat(num_states).expand(len(latent), -1)
        latent, first = (values.repeat_interleave(NUM_ACTIONS, dim=1) for values in (latent, first))
        return self.step(latent, first, action, code)

    def predict(self, latent: torch.Tensor, seen: torch.Tensor, code: Code) -> Predictions:
        """Returns the outputs of the heads."""
        to_goal = (code.positions[:, None, 2:] - self.locate(latent, code)) / 10
        inputs = torch.cat([self._body(latent), to_goal, self.hypermodel.task_features(seen, code)], dim=-1)
        out = self.heads(self.body(inputs))
        return Predictions(out[..., :NUM_ACTIONS], out[..., NUM_ACTIONS:-2], out[..., -2], out[..., -1])

    def value(self, value_logits: torch.Tensor) -> torch.Tensor:
        """Returns the means `[G, K]` of categorical values, in steps."""
        return torch.softmax(value_logits, dim=-1) @ self.support

    def _displacement(self, moved: torch.Tensor) -> torch.Tensor:
        """Returns displacements `[..., 2]` on the map (row, column) of those in metres (x, y)."""
        return _SCALE_RATE * (moved[..., None] * self.scale).sum(-2)

    def _body(self, latent: torch.Tensor) -> torch.Tensor:
        """Returns `[G, K, D + 14]`: heading, velocities, the code of the motion, and waves of the displacement."""
        return torch.cat([latent[..., 2:], waves(latent[..., :2])], dim=-1)


def rotate(vector: torch.Tensor, heading: torch.Tensor) -> torch.Tensor:
    """Returns vectors `[..., 2]`, turned by the angles whose sines and cosines are `heading` `[..., 2]`."""
    (x, y), (sine, cosine) = vector.unbind(-1), heading.unbind(-1)
    return torch.stack([cosine * x - sine * y, sine * x + cosine * y], dim=-1)
