"""The paper's DQN-dagger: Ape-X DQN with hindsight that gets no task context.

docs/agents/dqn.md describes the training, and how it differs from the paper.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import torch

from mazebench.agent import Inputs
from mazebench.constants import NUM_ACTIONS
from mazebench.errors import InputError

from ..common.actor import NetworkAgent, acting
from ..common.layers import in_batches, state_features
from .config import DQNConfig
from .learner import DQNLearner
from .network import STATES_AT_ONCE, QNetwork


class DQN(NetworkAgent):
    """Acts greedily by a Q-network that gets no context."""

    name: ClassVar[str] = "dqn"
    default_config: ClassVar[DQNConfig] = DQNConfig(use_context=False)
    learner_class: ClassVar[type[DQNLearner]] = DQNLearner
    config: DQNConfig
    network: QNetwork

    @classmethod
    def make_network(cls, config: DQNConfig, context_size: int) -> QNetwork:
        """Returns a new network.

        Raises:
          InputError: if the config wants the context.
        """
        if config.use_context:
            raise InputError("agent 'dqn': expected use_context False, found True; agent 'mah' gets the context")
        return QNetwork(config.hidden)

    def initial_state(self, batch_size: int) -> np.ndarray:
        """Returns the positions `[B, 2]` float32 (x, y) that were observed where the leg began."""
        return np.zeros((batch_size, 2), dtype=np.float32)

    @acting
    def act(self, inputs: Inputs, state: np.ndarray, explore: bool = False) -> tuple[np.ndarray, np.ndarray]:
        """Returns actions `[B]`."""
        # A new leg begins where the body is now.
        observed = inputs.observation["state"]
        state[inputs.new_context] = observed[inputs.new_context, :2]

        # The best action by the network, or now and then a random one.
        features = state_features(torch.from_numpy(observed), torch.from_numpy(state))[:, None]
        actions = in_batches(self.network, STATES_AT_ONCE, features)[:, 0].argmax(dim=-1).numpy()
        return self._explored(actions, NUM_ACTIONS) if explore else actions, state
