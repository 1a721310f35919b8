"""The paper's MAH: Ape-X DQN with hindsight that gets the task context.

docs/agents/dqn.md describes the training, and how it differs from the paper.
"""

from __future__ import annotations

from typing import ClassVar

from ..dqn.dqn import QAgent
from ..dqn.dqn_config import DQNConfig
from ..dqn.q_network import QNetwork
from .map_q_network import JoinedQNetwork, ReadingQNetwork


class _MapAgent(QAgent):
    """Acts greedily by a Q-network that gets the context."""

    needs_shown: ClassVar[tuple[str, ...]] = ("map", "goal")

    @classmethod
    def make_network(cls, config: DQNConfig, context_size: int) -> QNetwork:
        """Returns a new network."""
        if config.reading:
            return ReadingQNetwork(config.hidden, config.channels)
        return JoinedQNetwork(config.hidden, config.channels, context_size)

    @classmethod
    def serves_any_size(cls, config: DQNConfig) -> bool:
        """Returns whether the network reads the context at a position."""
        return config.reading


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
