"""The policy that sb3_her.py saved, as an agent of mazebench, and the features that it reads."""

import numpy as np
import torch
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.dqn.policies import MultiInputPolicy
from torch import nn

import mazebench
from mazebench.tasks.context import GOAL


class GoalFeatures(BaseFeaturesExtractor):
    """Convolutions of the map, on which the body's cell and the goal's are drawn, beside state and lidar."""

    def __init__(self, observation_space, num_features=256):
        lidar = observation_space.spaces.get("lidar")
        super().__init__(observation_space, num_features + 12 + (lidar.shape[0] if lidar else 0))
        self.reach = float(lidar.high.max()) if lidar else None
        self.metres = float(observation_space["desired_goal"].high[0])  # on a side of the maze
        self.side = round(((observation_space["observation"].shape[0] - 12) / 3) ** 0.5)  # M of the planes
        self.scale = torch.tensor([1 / self.metres] * 3 + [1.0] * 9)
        layers = []
        for channels, wider in ((5, 32), (32, 64), (64, 64)):  # each layer halves the side
            layers += [nn.Conv2d(channels, wider, 3, stride=2, padding=1), nn.ReLU()]
        num_pixels = ((self.side + 7) // 8) ** 2
        self.planes = nn.Sequential(*layers, nn.Flatten(), nn.Linear(64 * num_pixels, num_features), nn.ReLU())

    def forward(self, observations):
        state, shown = observations["observation"][:, :12], observations["observation"][:, 12:]
        drawn = [self.drawn(observations[key]) for key in ("achieved_goal", "desired_goal")]
        planes = torch.cat([shown.unflatten(1, (3, self.side, self.side)), torch.stack(drawn, dim=1)], dim=1)
        parts = [self.planes(planes), state * self.scale]
        if self.reach:
            parts.append(observations["lidar"] / self.reach)
        return torch.cat(parts, dim=1)

    def drawn(self, points):
        """Returns `[B, M, M]`: planes that are 1 in the cell of each point `[B, 2]`, x to the right and y up, in m."""
        cells = (points * self.side / self.metres).long().clamp(0, self.side - 1)
        planes = points.new_zeros(len(points), self.side, self.side)
        planes[torch.arange(len(points)), self.side - 1 - cells[:, 1], cells[:, 0]] = 1
        return planes


class HerAgent(mazebench.Agent):
    """Takes the action of the highest value; its cell is that of the observed position."""

    @classmethod
    def build(cls, interface, *, seed=0, checkpoint=None):
        if checkpoint is None:
            raise mazebench.InputError("expected --checkpoint, the file that sb3_her.py saved, found none")
        policy = MultiInputPolicy.load(checkpoint, device="cpu")
        side = policy.q_net.features_extractor.side
        if side not in (interface.size, interface.context_size):  # positions in metres belong to one size of mazes
            raise mazebench.UnplayableError(f"expected mazes of {side} cells a side, found {interface.size}")
        return cls(policy, side, interface.size, interface.cell_size)

    @classmethod
    def context_size(cls, size):
        return size  # a pixel for each cell

    def __init__(self, policy, side, size, cell_size):
        """`side` is M of the contexts that the policy was trained on."""
        self.policy, self.side, self.size, self.cell_size = policy, side, size, cell_size

    def act(self, inputs, state, explore=False):
        return self.policy.predict(self.goal_conditioned(inputs.observation), deterministic=True)[0], state

    def goal_conditioned(self, observation):
        """Returns what the goal-conditioned environment shows, which has the goal in no plane."""
        state, context = observation["state"], observation["context"]
        batch, side = len(context), context.shape[-1]
        row, column = np.divmod(context[:, GOAL].reshape(batch, -1).argmax(axis=1), side)
        goal = np.stack([column, side - 1 - row], axis=1) + 0.5  # x, y in pixels of the map
        planes = np.delete(context, GOAL, axis=1)
        factor = side // self.side  # of contexts that are larger than in training
        planes = planes.reshape(batch, 3, self.side, factor, self.side, factor).mean(axis=(3, 5))
        shown = {
            "observation": np.hstack([state, planes.reshape(batch, -1)]),
            "achieved_goal": (state[:, :2] // self.cell_size + 0.5) * self.cell_size,
            "desired_goal": goal * self.size * self.cell_size / side,
        }
        shown |= {name: observation[name] for name in self.needs_sensors}
        return {name: values.astype(np.float32) for name, values in shown.items()}


class LidarHerAgent(HerAgent):
    """The same with a lidar: the policy of `--tracks`."""

    needs_sensors = ("lidar",)
