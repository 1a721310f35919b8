"""Ape-X DQN with hindsight. With the task context it is the paper's MAH, without it its DQN-dagger.

docs/agents/dqn.md says what was trained, and how it differs from the paper.
"""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
import torch

from mazebench.agent import Interface, Observation

from ..actor import NetworkAgent
from ..checkpoint import check_shapes, load_agent, load_into
from ..layers import in_batches, state_features
from ..overrides import override
from .config import DQNConfig
from .network import NUM_ACTIONS, QNetwork

_ENCODED_AT_ONCE = 8  # contexts; few are new at a time
_ACTED_AT_ONCE = 64  # states


@dataclasses.dataclass
class ActorState:
    """What acting carries from step to step in B environments."""

    origin: np.ndarray  # [B, 2] float32, x and y observed where the context was new
    code: torch.Tensor | None  # [B, C + 4, M * M], the encoded contexts; None until there is one


class DQN(NetworkAgent):
    """Acts greedily by a Q-network; where it explores, environment i follows Ape-X's ladder of epsilons."""

    name: ClassVar[str] = "dqn"
    default_config: ClassVar[DQNConfig] = DQNConfig(use_context=False)
    network: QNetwork

    def __init__(self, config: DQNConfig, context_size: int, seed: int = 0):
        torch.set_num_threads(1)
        self.config = config
        self.context_size_built = context_size
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.network = _network(config)
        self.explore_from(0, config.num_envs, seed)

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> DQN:
        """The agent of a checkpoint, by default of the one that ships.

        Raises:
          InputError: if the checkpoint can't be used here.
        """
        path = cls.default_checkpoint() if checkpoint is None else checkpoint
        tensors, config, trained_size = load_agent(path, cls.name, cls.default_config)
        check_shapes(path, lambda: _network(config), tensors)
        agent = cls(config, trained_size, seed)
        load_into(path, agent.network, tensors)
        return agent

    @classmethod
    def build_learner(
        cls, interface: Interface, mazes: Any, *, seed: int = 0, overrides: Mapping[str, str] | None = None
    ) -> Any:
        """A learner of this agent's kind; see `mazebench.agent.LearningAgent`."""
        from .learner import DQNLearner

        config = override(cls.default_config, overrides or {})
        return DQNLearner(cls(config, interface.context_size, seed), tuple(mazes), seed)

    def initial_state(self, batch_size: int) -> ActorState:
        """No context encoded yet: `act` does it where one is first."""
        return ActorState(np.zeros((batch_size, 2), dtype=np.float32), None)

    @torch.no_grad()
    def act(
        self, observation: Observation, is_first: np.ndarray, state: ActorState, explore: bool = False
    ) -> tuple[np.ndarray, ActorState]:
        """Actions `[B]`; a context is encoded once, where it is new."""
        new = np.flatnonzero(is_first)
        if len(new):
            state.origin[new] = observation["state"][new, :2]
            if self.config.use_context:
                code = in_batches(self.network.encode, _ENCODED_AT_ONCE, torch.from_numpy(observation["context"][new]))
                if state.code is None:
                    state.code = code.new_zeros(len(state.origin), *code.shape[1:])
                state.code[new] = code
        features = state_features(torch.from_numpy(observation["state"]), torch.from_numpy(state.origin))[:, None]
        inputs = (features,) if state.code is None else (features, state.code)
        actions = in_batches(self.network, _ACTED_AT_ONCE, *inputs)[:, 0].argmax(dim=-1).numpy()
        if explore:
            actions = self._explored(actions, NUM_ACTIONS)
        return actions, state


class MAH(DQN):
    """The map-conditioned Ape-X HER DQN of the paper."""

    name = "mah"
    default_config = DQNConfig()


def _network(config: DQNConfig) -> QNetwork:
    return QNetwork(config.channels if config.use_context else 0, config.hidden)
