"""The paper's MAH: Ape-X DQN with hindsight that gets the task context.

docs/agents/dqn.md describes the training, and how it differs from the paper.
"""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np
import torch

from mazebench.agent import Inputs
from mazebench.constants import NUM_ACTIONS

from ..common.actor import NetworkAgent, acting
from ..common.layers import in_batches, state_features
from ..dqn.config import DQNConfig
from ..dqn.learner import DQNLearner
from ..dqn.network import STATES_AT_ONCE, QNetwork
from .network import JoinedQNetwork, ReadingQNetwork

_CONTEXTS_AT_ONCE = 8  # encoded; few are new in one step


@dataclasses.dataclass
class ActorState:
    """The state of acting in B environments."""

    origin: np.ndarray  # [B, 2] float32, x and y observed where the context was new
    code: torch.Tensor | None  # [B, ...], the encoded contexts; None before the first step


class _MapAgent(NetworkAgent):
    """Acts greedily by a Q-network that gets the context."""

    needs_shown: ClassVar[tuple[str, ...]] = ("map", "goal")
    learner_class: ClassVar[type[DQNLearner]] = DQNLearner
    config: DQNConfig
    network: QNetwork

    @classmethod
    def make_network(cls, config: DQNConfig, context_size: int) -> QNetwork:
        """Returns a new network."""
        if not config.use_context:
            return QNetwork(config.hidden)
        if config.reading:
            return ReadingQNetwork(config.hidden, config.channels)
        return JoinedQNetwork(config.hidden, config.channels, context_size)

    @classmethod
    def serves_any_size(cls, config: DQNConfig) -> bool:
        """Returns whether the network reads the context at a position, or not at all."""
        return config.reading or not config.use_context

    def initial_state(self, batch_size: int) -> ActorState:
        """Returns a state without codes: `act` encodes a context where it is new."""
        return ActorState(np.zeros((batch_size, 2), dtype=np.float32), None)

    @acting
    def act(self, inputs: Inputs, state: ActorState, explore: bool = False) -> tuple[np.ndarray, ActorState]:
        """Returns actions `[B]`."""
        # A new leg begins where the body is now; its context is encoded once.
        observed = inputs.observation["state"]
        new = np.flatnonzero(inputs.new_context)
        state.origin[new] = observed[new, :2]
        if len(new) and self.config.use_context:
            contexts = torch.from_numpy(inputs.observation["context"][new])
            code = in_batches(self.network.encode, _CONTEXTS_AT_ONCE, contexts)
            if state.code is None:
                state.code = code.new_zeros(len(state.origin), *code.shape[1:])
            state.code[new] = code

        # The best action by the network, or now and then a random one.
        features = state_features(torch.from_numpy(observed), torch.from_numpy(state.origin))[:, None]
        arguments = (features,) if state.code is None else (features, state.code)
        actions = in_batches(self.network, STATES_AT_ONCE, *arguments)[:, 0].argmax(dim=-1).numpy()
        return self._explored(actions, NUM_ACTIONS) if explore else actions, state


class MAH(_MapAgent):
    """The map-conditioned Ape-X HER DQN of the paper, which reads the map where it is."""

    name: ClassVar[str] = "mah"
    default_config: ClassVar[DQNConfig] = DQNConfig()


class MAHPaper(_MapAgent):
    """MAH with the paper's choices where it states them."""

    name: ClassVar[str] = "mah-paper"
    default_config: ClassVar[DQNConfig] = DQNConfig(
        reading=False, n_step=1, num_goals=1, relabel_start=False, symmetries=False, localization_weight=0.0
    )
