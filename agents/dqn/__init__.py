"""The paper's two model-free agents."""

from .dqn import DQN, MAH

__all__ = ["DQN", "MAH"]
