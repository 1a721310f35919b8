"""The paper's two model-free agents."""

from .dqn import DQN, MAH, MAHPaper

__all__ = ["DQN", "MAH", "MAHPaper"]
