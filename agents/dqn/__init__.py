"""The paper's model-free agent without context, and the Q-learning that it shares with MAH."""

from .dqn import DQN

__all__ = ["DQN"]
