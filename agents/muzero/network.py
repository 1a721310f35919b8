"""What networks with a latent model share: an encoder of states, motion, and heads.

`G` is the number of contexts, `K` of latent states in each, `M` the side of the context, `D` the size of a latent
state, `H` of the transition's hidden layer.
"""

from __future__ import annotations

import abc
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import nn

from ..common.layers import marked_position
from .config import MuZeroConfig

NUM_ACTIONS = 6
NUM_POSE = 4  # x and y moved, sine and cosine of yaw: the first numbers of a latent state, as of state features
NUM_BODY = 7  # and velocities forward, left and of yaw
NUM_FREE = 6  # of a step in the body's frame: a move, a turn, velocities forward, left and of yaw
NUM_STOPPED = 4  # in the map's: a move, velocities
NUM_CHANGES = NUM_FREE + NUM_STOPPED
# Contexts and states are computed as many at once, always, since PyTorch rounds differently at another batch size.
CONTEXTS_AT_ONCE = 16  # few are new in one step
STATES_AT_ONCE = 64
SCALE_RATE = 5.0  # the scale's parameters are multiplied by it, so that they are of the order of other weights
_RARE = -4.0  # logit of being in the goal, before anything is learned


class Predictions(NamedTuple):
    """The outputs of the heads for latent states."""

    policy_logits: torch.Tensor  # [G, K, 6]
    value_logits: torch.Tensor  # [G, K, bins], of whole values from 1 - bins to 0
    goal_logit: torch.Tensor  # [G, K], of being in the goal cell, which ends the episode


class Roots(NamedTuple):
    """Encoded states from which the model is unrolled, for losses that a network adds to those of all networks."""

    latent: torch.Tensor  # [G, K, D]
    position: torch.Tensor  # [G, K, 2], the true cell on the map (row, column)
    value: torch.Tensor  # [G, K], its target
    exists: torch.Tensor  # [G, K] bool
    going: torch.Tensor  # [G, K] bool, whether the state exists and is not in the goal


# The output of a hypermodel for G contexts: a NamedTuple of tensors [G, ...], the first of them `positions` [G, 4],
# anchor and goal on the map, each (row, column); the second `weights`, those that the hypermodel generates.
Code = Any


class Network(nn.Module, abc.ABC):
    """The paper's e (`encode`), h (`hypermodel`), f (`first_layer`, then `step`) and g (`predict`).

    A latent state holds the displacement from an anchor (m), heading, velocities and a learned code of the motion. The
    estimated position on the map is the anchor plus a learned linear map of the displacement. Subclasses have the
    hypermodel, the transition, and the inputs of the heads.
    """

    support: torch.Tensor  # [bins], the values that a categorical value weighs
    encoder: nn.Sequential
    hypermodel: nn.Module  # called with contexts, or beliefs, and anchors [G, 2], returns a Code
    scale: nn.Parameter
    body: nn.Sequential
    heads: nn.Linear

    def __init__(self, config: MuZeroConfig):
        super().__init__()
        self.latent_size = NUM_BODY + config.latent
        self.num_bins = config.longest_value + 1
        values = np.arange(-config.longest_value, 1, dtype=np.float32)
        self.register_buffer("support", torch.from_numpy(values), persistent=False)
        self.encoder = nn.Sequential(
            nn.Linear(NUM_BODY - NUM_POSE, config.hidden),
            nn.ReLU(inplace=True),
            nn.Linear(config.hidden, config.latent),
            nn.LayerNorm(config.latent),
        )

    @abc.abstractmethod
    def look(self, latent: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns what is read from the context at the positions of latent states, `[G, K, W]`."""

    @abc.abstractmethod
    def first_layer(self, latent: torch.Tensor, seen: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the transition's first layer without the action, `[G, K, H]`."""

    @abc.abstractmethod
    def step(self, latent: torch.Tensor, first: torch.Tensor, action: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the next latent states `[G, K, D]`, from the output of `first_layer` and actions `[G, K]`."""

    @abc.abstractmethod
    def predict(self, latent: torch.Tensor, seen: torch.Tensor, code: Code) -> Predictions:
        """Returns the outputs of the heads."""

    def parameter_groups(self) -> list[dict[str, Any]]:
        """Returns the optimizer's groups of parameters.

        `rate` multiplies the learning rate, and `constant_updates`, if given, stands for that of the config.
        """
        return [{"params": list(self.parameters()), "rate": 1.0}]

    def extra_losses(self, roots: Roots, code: Code) -> Iterator[tuple[str, torch.Tensor, torch.Tensor]]:
        """Yields the name, the errors and their weights of the network's own losses."""
        yield from ()

    def encode(self, features: torch.Tensor) -> torch.Tensor:
        """Returns latent states `[G, K, D]` of state features `[G, K, 9]`; see `state_features`."""
        return torch.cat([features[..., :NUM_BODY], self.encoder(features[..., NUM_POSE:NUM_BODY])], dim=-1)

    def decode(self, latent: torch.Tensor) -> torch.Tensor:
        """Returns the first seven state features `[G, K, 7]` of latent states."""
        return latent[..., :NUM_BODY]

    def locate(self, latent: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the estimated positions `[G, K, 2]` (row, column) of latent states on the map."""
        return code.positions[:, None, :2] + self.on_map(latent[..., :2])

    def step_all(self, latent: torch.Tensor, first: torch.Tensor, code: Code) -> torch.Tensor:
        """Returns the next latent states `[G, 6 K, D]` of every action; those of one state are neighbours."""
        num_states = latent.shape[1]
        action = torch.arange(NUM_ACTIONS, device=latent.device).repeat(num_states).expand(len(latent), -1)
        latent, first = (values.repeat_interleave(NUM_ACTIONS, dim=1) for values in (latent, first))
        return self.step(latent, first, action, code)

    def value(self, value_logits: torch.Tensor) -> torch.Tensor:
        """Returns the means `[G, K]` of categorical values, in steps."""
        return torch.softmax(value_logits, dim=-1) @ self.support

    def on_map(self, moved: torch.Tensor) -> torch.Tensor:
        """Returns displacements `[..., 2]` on the map (row, column) of those in metres (x, y)."""
        return SCALE_RATE * (moved[..., None] * self.scale).sum(-2)

    def _make_heads(self, num_inputs: int, num_outputs: int, config: MuZeroConfig) -> None:
        """Makes `body` and `heads`, whose first outputs are those of policy and value; at first they are constant."""
        self.body = nn.Sequential(
            nn.Linear(num_inputs, config.head_hidden),
            nn.ReLU(inplace=True),
            nn.Linear(config.head_hidden, config.head_hidden),
            nn.ReLU(inplace=True),
        )
        self.heads = nn.Linear(config.head_hidden, num_outputs)
        nn.init.zeros_(self.heads.weight)
        nn.init.zeros_(self.heads.bias)
        nn.init.constant_(self.heads.bias[NUM_ACTIONS + self.num_bins :], _RARE)


def rows_of(code: Code, rows: slice | torch.Tensor) -> Code:
    """Returns the codes of some of the contexts."""
    return code._make(part[rows] for part in code)


def with_codes(codes: Code | None, batch_size: int, rows: torch.Tensor, new: Code) -> Code:
    """Returns the codes of `batch_size` contexts, with `new` ones at `rows`; changes `codes`, None before the first."""
    if codes is None:
        codes = new._make(part.new_zeros(batch_size, *part.shape[1:]) for part in new)
    for whole, part in zip(codes, new, strict=True):
        whole[rows] = part
    return codes


def marked_positions(context: torch.Tensor, anchor: torch.Tensor | None) -> torch.Tensor:
    """Returns `[G, 4]`: the anchor, by default the marked start, and the marked goal."""
    start, goal = (marked_position(context[:, plane]) for plane in (3, 2))
    return torch.cat([start if anchor is None else anchor, goal], dim=-1)


def ahead_of(free: torch.Tensor, latent: torch.Tensor) -> torch.Tensor:
    """Returns `[G, K, 4]`, in the map's frame: the move and the velocity of free motion, given in the body's frame."""
    heading = latent[..., 2:NUM_POSE]
    return torch.cat([rotate(free[..., :2], heading), rotate(free[..., 3:5], heading)], dim=-1)


def moved_by(latent: torch.Tensor, free: torch.Tensor, change: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
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
    moved = latent[..., :2] + rotate(in_body[..., :2], heading) + in_map[..., :2]
    turn = torch.stack([torch.sin(in_body[..., 2]), torch.cos(in_body[..., 2])], dim=-1)
    turned = rotate(heading.flip(-1), turn).flip(-1)
    planar = in_body[..., 3:5] + rotate(in_map[..., 2:], heading * heading.new_tensor([-1.0, 1.0]))
    return torch.cat([moved, turned, planar, in_body[..., 5:]], dim=-1), motion


def rotate(vector: torch.Tensor, heading: torch.Tensor) -> torch.Tensor:
    """Returns vectors `[..., 2]`, turned by the angles whose sines and cosines are `heading` `[..., 2]`."""
    (x, y), (sine, cosine) = vector.unbind(-1), heading.unbind(-1)
    return torch.stack([cosine * x - sine * y, sine * x + cosine * y], dim=-1)
