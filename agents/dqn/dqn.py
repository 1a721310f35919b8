"""Ape-X DQN with hindsight. With the task context it is the paper's MAH, without it the paper's DQN-dagger.

docs/agents/dqn.md describes the training, and how it differs from the paper.
"""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Mapping, Sequence
from typing import ClassVar, Self

import numpy as np
import torch

from mazebench.agent import Inputs, Interface
from mazebench.maps.maze import Maze

from ..common.actor import NetworkAgent
from ..common.checkpoint import check_shapes, check_size, load_agent, load_into
from ..common.layers import in_batches, state_features
from ..common.overrides import override
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
    config: DQNConfig
    network: QNetwork

    def __init__(self, config: DQNConfig, context_size: int, seed: int = 0):
        torch.set_num_threads(1)
        self.config = config
        self.trained_size = context_size
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.network = _network(config, context_size)
        self.explore_from(0, config.num_envs, seed)

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> Self:
        """Returns the agent of a checkpoint, by default of the one that ships.

        Raises:
          InputError: if the checkpoint can't be used here.
        """
        path = cls.default_checkpoint() if checkpoint is None else checkpoint
        tensors, config, trained_size = load_agent(path, cls.name, cls.default_config)
        if config.use_context and not config.reading:
            check_size(path, trained_size, interface.context_size)
        check_shapes(path, lambda: _network(config, trained_size), tensors)
        agent = cls(config, trained_size, seed)
        load_into(path, agent.network, tensors)
        return agent

    @classmethod
    def build_learner(
        cls, interface: Interface, mazes: Sequence[Maze], *, seed: int = 0, overrides: Mapping[str, str] | None = None
    ) -> DQNLearner:
        """Returns a learner for an agent of this class."""
        config = override(cls.default_config, overrides or {})
        return DQNLearner(cls(config, interface.context_size, seed), tuple(mazes), seed)

    def initial_state(self, batch_size: int) -> ActorState:
        """Returns a state without codes: `act` encodes a context where it is new."""
        return ActorState(np.zeros((batch_size, 2), dtype=np.float32), None)

    @torch.no_grad()
    def act(self, inputs: Inputs, state: ActorState, explore: bool = False) -> tuple[np.ndarray, ActorState]:
        """Returns actions `[B]`."""
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


def _network(config: DQNConfig, context_size: int) -> QNetwork:
    if not config.use_context:
        return QNetwork(config.hidden)
    if config.reading:
        return ReadingQNetwork(config.hidden, config.channels)
    return JoinedQNetwork(config.hidden, config.channels, context_size)
