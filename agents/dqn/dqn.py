"""The acting of DQN and MAH, and the paper's DQN†: Ape-X DQN with hindsight that gets no task context.

docs/agents/dqn.md describes the training, and how it differs from the paper.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import torch

from mazebench.agent import Inputs

from ..common.actor import ActorState, NetworkAgent, acting
from ..common.layers import in_batches, state_features
from .dqn_config import DQNConfig
from .q_learner import DQNLearner
from .q_network import CONTEXTS_AT_ONCE, STATES_AT_ONCE, QNetwork


class QAgent(NetworkAgent):
    """Acts greedily by a Q-network."""

    learner_class: ClassVar[type[DQNLearner]] = DQNLearner
    config: DQNConfig
    network: QNetwork

    @acting
    def act(self, inputs: Inputs, state: ActorState, explore: bool = False) -> tuple[np.ndarray, ActorState]:
        """Returns actions `[B]`."""
        # A new leg begins where the body is now, from where displacements are measured; its context is encoded once.
        observed = inputs.observation["state"]
        new = np.flatnonzero(inputs.new_context)
        state.origin[new] = observed[new, :2]
        if len(new) and self.network.reads_context:
            contexts = torch.from_numpy(inputs.observation["context"][new])
            code = in_batches(self.network.encode, CONTEXTS_AT_ONCE, contexts)
            if state.code is None:
                state.code = code.new_zeros(len(state.origin), *code.shape[1:])
            state.code[new] = code

        # The best action by the network, or now and then a random one.
        features = state_features(torch.from_numpy(observed), torch.from_numpy(state.origin))[:, None]
        arguments = (features,) if state.code is None else (features, state.code)
        actions = in_batches(self.network, STATES_AT_ONCE, *arguments)[:, 0].argmax(dim=-1).numpy()
        return self._explored(actions) if explore else actions, state


class DQN(QAgent):
    """The Ape-X DQN of the paper, whose Q-network gets no context."""

    name: ClassVar[str] = "dqn"
    default_config: ClassVar[DQNConfig] = DQNConfig()

    @classmethod
    def make_network(cls, config: DQNConfig, context_size: int) -> QNetwork:
        """Returns a new network."""
        return QNetwork(config.hidden)
