"""The Q-networks of MAH: with the map's features at the estimated position, or with one code of the whole context.

`G` is the number of contexts, `K` of states in each, `M` the side of the context, `C` of channels, `Q` of numbers of a
code.
"""

from __future__ import annotations

import math

import torch
from torch import nn

from ..common.layers import (
    FAR_DILATIONS,
    NEAR_DILATIONS,
    NUM_PLACE,
    NUM_TO_GOAL,
    NUM_WAVES,
    SCALE_RATE,
    MapEncoder,
    goal_code,
    marked_position,
    place_code,
    position_code,
    waves,
)
from ..dqn.q_network import QNetwork

_CODE = 256  # numbers of a code of the whole context


class ReadingQNetwork(QNetwork):
    """Reads features of the map at the estimated position: the start plus a learned linear map of the displacement."""

    reads_context = True

    def __init__(self, hidden: int, channels: int):
        super().__init__(hidden, channels + 2 + NUM_WAVES)
        self.channels = channels
        self.encoder = MapEncoder(channels, FAR_DILATIONS)
        self.scale = nn.Parameter(torch.zeros(2, 2))
        self.sharpness = nn.Parameter(torch.tensor(0.0))

    def encode(self, context: torch.Tensor) -> torch.Tensor:
        """Returns codes `[G, C + 4, M * M]` of contexts: features of the map, positions of start and goal."""
        planes = self.encoder(context).flatten(2)
        positions = [marked_position(context[:, plane]) for plane in (3, 2)]  # start, goal
        size = planes.shape[-1]
        return torch.cat([planes, torch.cat(positions, dim=-1)[:, :, None].expand(-1, -1, size)], dim=1)

    def locate(self, moved: torch.Tensor, code: torch.Tensor) -> torch.Tensor:
        """Returns estimated positions `[G, K, 2]` (row, column) on the map after displacements `moved` (m)."""
        start = code[:, self.channels : self.channels + 2, 0]
        return _moved_from(start, moved, self.scale)

    def read(self, moved: torch.Tensor, code: torch.Tensor) -> torch.Tensor:
        """Returns `[G, K, C + 18]`: features of the map around the body, the goal's offset, waves of `moved`."""
        position = self.locate(moved, code)
        where = position_code(position, math.isqrt(code.shape[-1]), self.sharpness)
        local = where @ code[:, : self.channels].transpose(1, 2)
        to_goal = (code[:, self.channels + 2 :, 0][:, None] - position) / 10.0
        return torch.cat([local, to_goal, waves(moved)], dim=-1)


class JoinedQNetwork(QNetwork):
    """Joins the state with one code of the whole context, of a fixed size, and with codes of the estimated position."""

    reads_context = True

    def __init__(self, hidden: int, channels: int, context_size: int):
        super().__init__(hidden, _CODE + NUM_PLACE + NUM_TO_GOAL)
        self._size = context_size
        self.encoder = MapEncoder(channels, NEAR_DILATIONS)
        self.embedding = nn.Sequential(nn.Linear(channels * context_size**2, _CODE), nn.LayerNorm(_CODE))
        self.scale = nn.Parameter(torch.zeros(2, 2))

    def encode(self, context: torch.Tensor) -> torch.Tensor:
        """Returns codes `[G, Q + 4]` of contexts: of the whole, positions of start and goal."""
        positions = [marked_position(context[:, plane]) for plane in (3, 2)]  # start, goal
        return torch.cat([self.embedding(self.encoder(context).flatten(1)), *positions], dim=-1)

    def read(self, moved: torch.Tensor, code: torch.Tensor) -> torch.Tensor:
        """Returns `[G, K, Q + 40]`: the code of the context, of the estimated positions, and of the way to the goal."""
        whole, marks = code[:, :_CODE], code[:, _CODE:]
        position = _moved_from(marks[:, :2], moved, self.scale)
        # What tells goals apart trains the scale.
        places = place_code(position.detach(), marks, self._size)
        to_goal = goal_code(position, marks[:, 2:])
        return torch.cat([whole[:, None].expand(-1, moved.shape[1], -1), places, to_goal], dim=-1)


def _moved_from(start: torch.Tensor, moved: torch.Tensor, scale: torch.Tensor) -> torch.Tensor:
    """Returns positions `[G, K, 2]`: `start` `[G, 2]` plus a linear map of displacements `moved` `[G, K, 2]` (m)."""
    return start[:, None] + SCALE_RATE * (moved @ scale)
