"""Inputs of agents, made by hand, and an agent that explores at random."""

from __future__ import annotations

import numpy as np

from mazebench.agent import Inputs, Observation
from mazebench.training.protocol import LearningAgent


def inputs_of(observation: Observation, new_context: np.ndarray, new_episode: np.ndarray | None = None) -> Inputs:
    """Returns inputs whose seeds are 0; without `new_episode`, every new context begins an episode."""
    seed = np.zeros(len(new_context), dtype=np.int64)
    return Inputs(observation, new_context if new_episode is None else new_episode, new_context, seed)


class RandomActor(LearningAgent):
    """Explores by random actions."""

    def explore_from(self, seed):
        self._rng = np.random.default_rng(seed)

    def act(self, inputs, state, explore=False):
        return self._rng.integers(6, size=len(inputs.seed)), state
