"""Stable-Baselines3: many environments at once, and features of their observations (extra `[sb3]`).

>>> envs = MazeVecEnv(mazebench.make_vec("rebuilt", 64))
>>> model = PPO("MultiInputPolicy", envs, policy_kwargs={"features_extractor_class": WayFeatures})
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from gymnasium.spaces import Box
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper
from torch import nn

from mazebench.constants import FORWARD_VELOCITY, LEFT_VELOCITY, STATE_SIZE, YAW, YAW_RATE, X, Y
from mazebench.envs.vector import MazeVectorEnv
from mazebench.errors import InputError
from mazebench.tasks.context import GLOBAL_MAP, GOAL
from mazebench.tasks.sensors import LIDAR, unread

from ..neural_planner.network import NUM_RANGES, REACH, CostPlanner, Situation, motion_features
from ..neural_planner.neural_planner_config import NeuralPlannerConfig
from .distance_field import DistanceField

if TYPE_CHECKING:
    from gymnasium import spaces


_READ = ("state", "context", LIDAR)  # by all features below


class MazeVecEnv(VecEnv):
    """A vector environment of mazebench with the interface of Stable-Baselines3.

        >>> envs = MazeVecEnv(mazebench.make_vec("building", 16, split="train", reward="progress"))
        >>> PPO("MultiInputPolicy", envs, policy_kwargs={"features_extractor_class": MapFeatures})

    At the end of an episode, `infos` have what mazebench's `info` told then, and what Stable-Baselines3 looks for:
    `terminal_observation`, `TimeLimit.truncated` and `is_success`, which it logs as success_rate.
    """

    def __init__(self, envs: MazeVectorEnv):
        """Takes over `envs`, which `close` closes.

        Raises:
          InputError: unless the next episode begins in the step that ends one.
        """
        if envs.autoreset_mode.value != "SameStep":
            raise InputError(f"expected autoreset_mode 'SameStep', found {envs.autoreset_mode.value!r}")
        self.envs = envs
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)

    def reset(self) -> dict[str, np.ndarray]:
        # The seeds are those of `seed`, or None for each environment; the options those of `set_options`.
        if any(options != self._options[0] for options in self._options):
            raise InputError("expected the same options for all environments, found different ones")
        observations, _ = self.envs.reset(seed=self._seeds, options=self._options[0])
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: np.ndarray) -> None:
        self._actions = actions

    def step_wait(self) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray, list[dict[str, Any]]]:
        observations, rewards, terminated, truncated, info = self.envs.step(self._actions)
        ended = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for slot in np.flatnonzero(ended):
            told = {name: values[slot] for name, values in info["final_info"].items() if not name.startswith("_")}
            infos[slot] = told | {
                "terminal_observation": info["final_obs"][slot],
                "TimeLimit.truncated": bool(truncated[slot]),
                "is_success": bool(terminated[slot]),
            }
        return observations, rewards, ended, infos

    def close(self) -> None:
        self.envs.close()

    # The environments are one object: all of them have its attributes, and its methods act on all.
    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        return [getattr(self.envs, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        self._require_all(indices)
        setattr(self.envs, attr_name, value)

    def env_method(self, method_name: str, *arguments: Any, indices: Any = None, **options: Any) -> list[Any]:
        self._require_all(indices)
        return [getattr(self.envs, method_name)(*arguments, **options)] * self.num_envs

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        return [False for _ in self._get_indices(indices)]

    def _require_all(self, indices: Any) -> None:
        if sorted(self._get_indices(indices)) != list(range(self.num_envs)):
            raise InputError(f"expected no indices, for the environments are one object, found {indices}")

    def get_images(self) -> Sequence[np.ndarray | None]:
        return self.envs.render()


class FieldVecEnv(VecEnvWrapper):
    """Flat observations instead of those of a `MazeVecEnv`: the features of `DistanceField`, for "MlpPolicy".

        >>> envs = FieldVecEnv(MazeVecEnv(mazebench.make_vec(("building", "rebuilt"), 64, reward="progress")))
        >>> model = PPO("MlpPolicy", envs)

    Raises:
      InputError: if there are sensors other than the lidar, which the features would leave out.
    """

    venv: MazeVecEnv

    def __init__(self, venv: MazeVecEnv):
        _require_read("FieldVecEnv", venv.observation_space)
        self.field = DistanceField(venv.num_envs)
        spaces = venv.envs.single_observation_space.spaces  # type: ignore[attr-defined]  # a Dict
        size = self.field.num_features(spaces["lidar"].shape[0] if "lidar" in spaces else 0)
        super().__init__(venv, Box(-np.inf, np.inf, (size,), np.float32))

    def reset(self) -> np.ndarray:
        observations = self.venv.reset()
        self.field.read(observations["context"], np.ones(self.num_envs, dtype=bool))
        return self.field.features(observations)

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        observations, rewards, dones, infos = self.venv.step_wait()
        # The last observations of episodes are on their own maps, so they come before the new maps are read.
        for slot in np.flatnonzero(dones):
            last = {name: values[None] for name, values in infos[slot]["terminal_observation"].items()}
            infos[slot]["terminal_observation"] = self.field.features(last, np.array([slot]))[0]
        self.field.read(observations["context"], dones)
        return self.field.features(observations), rewards, dones, infos


class MapFeatures(BaseFeaturesExtractor):
    """Convolutions of the context, and the state and the lidar, if there is one, in values of an order of 1.

    Without it, "MultiInputPolicy" flattens the context: float32 is no picture to Stable-Baselines3.

    Raises:
      InputError: if there are other observations.
    """

    scale: torch.Tensor  # [12], by which the state is multiplied

    def __init__(self, observation_space: spaces.Dict, num_features: int = 256):
        """`num_features` are those of the context."""
        _require_read("MapFeatures", observation_space)
        lidar = observation_space.spaces.get("lidar")
        num_rays = 0 if lidar is None else lidar.shape[0]  # type: ignore[index]  # a Box has a shape
        super().__init__(observation_space, num_features + STATE_SIZE + num_rays)
        channels, side, _ = observation_space["context"].shape  # type: ignore[misc]  # likewise
        scale = torch.tensor([1 / side] * 3 + [1.0] * (STATE_SIZE - 3))  # positions are in metres
        self.register_buffer("scale", scale, persistent=False)
        self.reach = None if lidar is None else float(lidar.high.max())  # type: ignore[attr-defined]
        layers: list[nn.Module] = []
        for wider in (32, 64, 64):  # each layer halves the side
            layers += [nn.Conv2d(channels, wider, 3, stride=2, padding=1), nn.ReLU()]
            channels, side = wider, (side + 1) // 2
        self.context = nn.Sequential(*layers, nn.Flatten(), nn.Linear(channels * side**2, num_features), nn.ReLU())

    def forward(self, observations: dict[str, torch.Tensor]) -> torch.Tensor:
        parts = [self.context(observations["context"]), observations["state"] * self.scale]
        if self.reach:
            parts.append(observations["lidar"] / self.reach)
        return torch.cat(parts, dim=1)  # [B, features]


class WayFeatures(BaseFeaturesExtractor):
    """The cheapest ways over the context's map, by learned costs, around the body: those of `neural-planner`.

    It has no memory, so the map is all that it plans on, beside the lidar's ranges to the walls that are near. It
    reads maps whose cells are 1 m wide.

    Raises:
      InputError: if there are sensors other than the lidar.
    """

    def __init__(self, observation_space: spaces.Dict):
        _require_read("WayFeatures", observation_space)
        super().__init__(observation_space, CostPlanner.num_features)
        self.planner = CostPlanner(NeuralPlannerConfig.channels)

    def forward(self, observations: dict[str, torch.Tensor]) -> torch.Tensor:
        context, state = observations["context"], observations["state"]
        walls, goal = context[:, GLOBAL_MAP], context[:, GOAL]
        # Nothing but the map is known of walls. All cells may be the goal if it is hidden.
        goal_is_hidden = goal.amax(dim=(1, 2), keepdim=True) == 0
        planes = [255 * walls, 255 * walls, torch.full_like(walls, 128), 255 * ((goal <= 0) & ~goal_is_hidden)]
        plan = self.planner.plan(torch.stack(planes, dim=1).round().to(torch.uint8))

        batch_size = len(state)
        ranges = state.new_full((batch_size, NUM_RANGES), REACH)
        if "lidar" in observations:
            ranges = observations["lidar"].clamp(max=REACH)
        velocity = state[:, [FORWARD_VELOCITY, LEFT_VELOCITY, YAW_RATE]].cpu().numpy()
        motion = torch.from_numpy(motion_features(velocity, np.full((batch_size, 2), -1)))  # no last actions
        situation = Situation(state[:, [X, Y, YAW]], ranges, motion.to(state.device))
        return self.planner.features(plan, torch.arange(batch_size, device=state.device), situation)  # [B, features]


def _require_read(features: str, observation_space: Any) -> None:
    """Raises `InputError` if some of the observations are none that the features are of."""
    if line := unread(features, observation_space.spaces, _READ):
        raise InputError(line)
