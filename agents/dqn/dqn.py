"""Ape-X DQN with hindsight. With the task context it is the paper's MAH, without it the paper's DQN-dagger.

docs/agents/dqn.md describes the training, and how it differs from the paper.
"""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np
import torch

from mazebench.agent import Inputs

from ..common.actor import NetworkAgent, one_torch_thread
from ..common.bounds import bounded
from ..common.layers import in_batches, state_features
from .config import DQNConfig
from .learner import DQNLearner
from .network import NUM_ACTIONS, JoinedQNetwork, QNetwork, ReadingQNetwork

_CONTEXTS_AT_ONCE = 8  # encoded; few are new in one step
_STATES_AT_ONCE = 64


@dataclasses.dataclass
class ActorState:
    """The state of acting in B environments."""

    origin: np.ndarray  # [B, 2] float32, x and y observed where the context was new
    code: torch.Tensor | None  # [B, ...], the encoded contexts; None before the first step, or without context


class DQN(NetworkAgent):
    """Acts greedily by a Q-network that gets no context."""

    name: ClassVar[str] = "dqn"
    default_config: ClassVar[DQNConfig] = DQNConfig(use_context=False)
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

    @torch.no_grad()
    @one_torch_thread()
    def act(self, inputs: Inputs, state: ActorState, explore: bool = False) -> tuple[np.ndarray, ActorState]:
        """Returns actions `[B]`."""
        inputs = bounded(inputs)
        observed = inputs.observation["state"]
        new = np.flatnonzero(inputs.new_context)
        if len(new):
            state.origin[new] = observed[new, :2]
            if self.config.use_context:
                contexts = torch.from_numpy(inputs.observation["context"][new])
                code = in_batches(self.network.encode, _CONTEXTS_AT_ONCE, contexts)
                if state.code is None:
                    state.code = code.new_zeros(len(state.origin), *code.shape[1:])
                state.code[new] = code
        features = state_features(torch.from_numpy(observed), torch.from_numpy(state.origin))[:, None]
        arguments = (features,) if state.code is None else (features, state.code)
        actions = in_batches(self.network, _STATES_AT_ONCE, *arguments)[:, 0].argmax(dim=-1).numpy()
        if explore:
            actions = self._explored(actions, NUM_ACTIONS)
        return actions, state


class MAH(DQN):
    """The map-conditioned Ape-X HER DQN of the paper: acts greedily by a Q-network that gets the context."""

    name = "mah"
    default_config = DQNConfig()


class MAHPaper(DQN):
    """MAH with the paper's choices where it states them."""

    name = "mah-paper"
    default_config = DQNConfig(
        reading=False, n_step=1, num_goals=1, relabel_start=False, symmetries=False, localization_weight=0.0
    )
