"""The network of the neural planner: costs of cells, cheapest ways over them, and a policy that reads both.

`G` is the number of grids, `L` of cells on a side of each, `K` of states, `P` of points around the body. Lengths are in
cells. A pose is x, y and yaw (rad), with x to the right, y up and the grid's lower left corner at (0, 0).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from torch import nn

from mazebench.constants import NUM_ACTIONS

from ..common.layers import VELOCITY_UNIT, ring_points
from ..common.path_layer import FAR, CheapestWays, cell_costs, cost_layers
from ..robot.beams import MOST_EVIDENCE

NUM_RANGES = 32  # to the walls around the body
REACH = 3.5  # cells, of these ranges
_POINTS = ring_points((0.4, 0.8, 1.2, 1.8, 2.5, REACH), 16)  # [97, 2], cells
_NUM_MOTION = 3 + 2 * NUM_ACTIONS
_NUM_FEATURES = 3 * len(_POINTS) + NUM_RANGES + _NUM_MOTION + 2

_EVIDENCE = 120 / MOST_EVIDENCE  # levels a unit of log odds, in a picture's bytes
_UNLIKELY = 32.0  # levels a unit of the log of a goal's likelihood
_NO_GOAL = 255
_FIRST = -0.5  # score of a cell before anything is learned
_AT_ONCE = 16  # grids, whose features then stay in the cache


class Plan(NamedTuple):
    """Inputs of the policy from `G` grids."""

    way: torch.Tensor  # [G, L, L] float32, the cost of the cheapest way to the goal
    cost: torch.Tensor  # [G, L, L] float32, of each cell
    wall: torch.Tensor  # [G, L, L] float32, the probability of a wall


class Situation(NamedTuple):
    """`K` states of bodies."""

    pose: torch.Tensor  # [K, 3] float32
    ranges: torch.Tensor  # [K, 32] float32, to the walls around the body, counter-clockwise from straight ahead
    motion: torch.Tensor  # [K, 15] float32, see `motion_features`


def grid_bytes(prior: np.ndarray, walls: np.ndarray, evidence: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """Returns the network's input for a grid, `[4, L, L]` uint8: bytes, because learners keep many.

    All are `[L, L]` float: the probability of a wall by the map, by map and senses, and its log odds by senses, within
    `MOST_EVIDENCE` of 0; then weights of the goal; where all are 0, any cell may be it.
    """
    likely = goal / goal.max() if goal.any() else np.ones_like(goal)
    unlikely = np.minimum(-_UNLIKELY * np.log(np.maximum(likely, 1e-9)), _NO_GOAL)
    return np.rint(np.stack([255 * prior, 255 * walls, 128 + _EVIDENCE * evidence, unlikely])).astype(np.uint8)


class CostPlanner(nn.Module):
    """Gives the cells of grids of any size costs, finds the cheapest ways over them, and reads both around a body."""

    num_features = _NUM_FEATURES

    def __init__(self, channels: int, ways: bool = True):
        """`channels` are those of the costs; without `ways`, all cells cost 1."""
        super().__init__()
        self._has_ways = ways
        self.costs = cost_layers(5, channels)
        # Of what a goal costs that is less likely than another one; the navigator's price has this form, too. Adam
        # moves a single weight by little, so its start decides; it was chosen on train mazes.
        self.goal_scale = nn.Parameter(torch.tensor(10.0))

    def plan(self, grids: torch.Tensor) -> Plan:
        """Returns the plan on grids `[G, 4, L, L]` uint8 (see `grid_bytes`)."""
        prior, wall = grids[:, 0] / 255, grids[:, 1] / 255
        evidence = (grids[:, 2] - 128.0) / (4 * _EVIDENCE)
        seen_wall, seen_free = evidence.clamp(min=0), (-evidence).clamp(min=0)
        planes = torch.stack([prior, wall, seen_wall, seen_free, torch.ones_like(wall)], dim=1)
        scores = torch.cat([self.costs(some)[:, 0] for some in planes.split(_AT_ONCE)])
        cost = cell_costs(_FIRST + scores)
        unlikely = grids[:, 3] / _UNLIKELY
        end = torch.where(grids[:, 3] < _NO_GOAL, nn.functional.softplus(self.goal_scale) * torch.expm1(unlikely), FAR)
        way = CheapestWays.apply(cost if self._has_ways else torch.ones_like(cost), end)
        return Plan(way, cost, wall)

    def features(self, plan: Plan, grid: torch.Tensor, situation: Situation) -> torch.Tensor:
        """Returns `[K, F]`: what is read of the plan at points around the bodies, in their own frames, and the rest.

        The states are on the grids `grid` (`[K]` int) of the plan.
        """
        size = plan.way.shape[-1]
        first = grid[:, None] * size * size  # of a state's grid, among the cells of all grids

        # The points, and the four cells whose centres are around each.
        pose = situation.pose
        cosine, sine = torch.cos(pose[:, 2:]), torch.sin(pose[:, 2:])
        ahead, left = _POINTS.to(pose.device).T
        column = (pose[:, :1] + cosine * ahead - sine * left - 0.5).clamp(0, size - 1.001)
        row = (size - 0.5 - pose[:, 1:2] - sine * ahead - cosine * left).clamp(0, size - 1.001)
        right, down = column.frac(), row.frac()
        corner = first + row.long() * size + column.long()
        corners = torch.stack([corner, corner + 1, corner + size, corner + size + 1])  # [4, K, P]
        weights = torch.stack([(1 - right) * (1 - down), right * (1 - down), (1 - right) * down, right * down])

        # How much nearer the goal is there than at the body. A wall outweighs no free cell next to it.
        here = (size - pose[:, 1:2]).long().clamp(0, size - 1) * size + pose[:, :1].long().clamp(0, size - 1)
        way_left = plan.way.flatten()[first + here]  # [K, 1]
        nearness = torch.exp(((way_left - plan.way.flatten()[corners]) / 2).clamp(-8, 8))
        nearer = torch.log((weights * nearness).sum(0) + 1e-3)

        return torch.cat(
            [
                (nearer - nearer[:, :1]).clamp(-4, 4),
                (weights * torch.log(plan.cost).flatten()[corners]).sum(0) / 3,
                (weights * plan.wall.flatten()[corners]).sum(0),
                situation.ranges / REACH,
                situation.motion,
                torch.tanh(way_left / 5),
                torch.tanh(way_left / 40),
            ],
            dim=1,
        )


class PlannerNetwork(CostPlanner):
    """Plans, and acts by what it reads of the plan around the body."""

    def __init__(self, channels: int, hidden: int, ways: bool):
        """`channels` are those of the costs, `hidden` units those of the policy; without `ways`, all cells cost 1."""
        super().__init__(channels, ways)
        self.policy = nn.Sequential(
            nn.Linear(_NUM_FEATURES, hidden), nn.ReLU(), nn.Linear(hidden, hidden), nn.ReLU(),
            nn.Linear(hidden, NUM_ACTIONS),
        )  # fmt: skip
        self.value = nn.Sequential(nn.Linear(_NUM_FEATURES, hidden // 2), nn.ReLU(), nn.Linear(hidden // 2, 1))

    def forward(self, plan: Plan, grid: torch.Tensor, situation: Situation) -> tuple[torch.Tensor, torch.Tensor]:
        """Returns logits `[K, 6]` and values `[K]` of states on the grids `grid` (`[K]` int) of a plan."""
        features = self.features(plan, grid, situation)
        return self.policy(features), self.value(features)[:, 0]


def motion_features(velocity: np.ndarray, actions: np.ndarray) -> np.ndarray:
    """Returns `Situation.motion` of velocities and actions.

    Args:
      velocity: `[K, 3]`, forward and to the left in cells a second, and the yaw rate in rad/s.
      actions: `[K, 2]` int, the last one and the one before, -1 for none.
    """
    one_hots = actions[..., None] == np.arange(NUM_ACTIONS)
    return np.concatenate([velocity / VELOCITY_UNIT, one_hots.reshape(len(actions), -1)], axis=1).astype(np.float32)
