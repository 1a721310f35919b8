"""What DQN and MMN share as agents: a network's numbers, the ladder of epsilons, the checkpoint that ships."""

from __future__ import annotations

import pathlib
from importlib import resources
from typing import Any, ClassVar

import numpy as np
import torch


class NetworkAgent:
    """An agent that acts by a network, and at random by Ape-X's ladder of epsilons where it explores."""

    name: ClassVar[str]
    config: Any  # has num_envs, epsilon_base and epsilon_alpha
    network: torch.nn.Module

    def explore_from(self, first_env: int, num_envs: int, seed: int) -> None:
        """Takes the rungs `first_env` to `first_env + num_envs` of the ladder, and a new stream of random numbers.

        Up the ladder there are fewer random actions.
        """
        rung = (first_env + np.arange(num_envs)) / max(1, self.config.num_envs - 1)
        self._epsilon = self.config.epsilon_base ** (1 + self.config.epsilon_alpha * rung)
        self._rng = np.random.default_rng(seed)

    def parameters(self) -> dict[str, np.ndarray]:
        """The network's, by name."""
        return {name: value.cpu().numpy().copy() for name, value in self.network.state_dict().items()}

    def set_parameters(self, parameters: dict[str, np.ndarray]) -> None:
        """Takes over another network's."""
        self.network.load_state_dict({name: torch.from_numpy(value.copy()) for name, value in parameters.items()})

    @classmethod
    def default_checkpoint(cls) -> pathlib.Path:
        """The checkpoint that ships."""
        path = resources.files("mazebench_assets").joinpath("checkpoints", f"{cls.name}-13.safetensors")
        return pathlib.Path(str(path))

    def _explored(self, actions: np.ndarray, num_actions: int) -> np.ndarray:
        """`actions` `[B]`, some of them replaced by random ones."""
        at_random = self._rng.random(len(actions)) < self._epsilon
        return np.where(at_random, self._rng.integers(num_actions, size=len(actions)), actions)
