"""The parts of an agent that DQN and MMN share: parameters, exploration, and the checkpoint that ships."""

from __future__ import annotations

import pathlib
from importlib import resources
from typing import Any, ClassVar

import numpy as np
import torch

from mazebench.training.protocol import LearningAgent


class NetworkAgent(LearningAgent):
    """An agent that acts by a network; where it explores, environment i takes random actions at Ape-X's rate i."""

    name: ClassVar[str]
    config: Any  # has num_envs, epsilon_base and epsilon_alpha
    network: Any  # a torch.nn.Module
    trained_size: int  # M of the contexts that the network was made for

    def explore_from(self, first_env: int, num_envs: int, seed: int) -> None:
        """Begins a new stream of exploration, as the environments from `first_env` on of the learner's.

        The rate of random actions falls from the first environment to the last (Horgan et al. 2018).
        """
        rung = (first_env + np.arange(num_envs)) / max(1, self.config.num_envs - 1)
        self._epsilon = self.config.epsilon_base ** (1 + self.config.epsilon_alpha * rung)
        self._rng = np.random.default_rng(seed)

    def parameters(self) -> dict[str, np.ndarray]:
        """Returns the network's, by name."""
        return {name: value.cpu().numpy().copy() for name, value in self.network.state_dict().items()}

    def set_parameters(self, parameters: dict[str, np.ndarray]) -> None:
        """Takes over the parameters of another network."""
        self.network.load_state_dict({name: torch.from_numpy(value.copy()) for name, value in parameters.items()})

    @classmethod
    def default_checkpoint(cls) -> pathlib.Path:
        """Returns the checkpoint that ships."""
        path = resources.files("mazebench_assets").joinpath("checkpoints", f"{cls.name}-13.safetensors")
        return pathlib.Path(str(path))

    def _explored(self, actions: np.ndarray, num_actions: int) -> np.ndarray:
        """Returns `actions` `[B]`, some of them replaced by random ones."""
        at_random = self._rng.random(len(actions)) < self._epsilon
        return np.where(at_random, self._rng.integers(num_actions, size=len(actions)), actions)
