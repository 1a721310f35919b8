"""The agent that acts uniformly at random."""

from .random_agent import RandomAgent

__all__ = ["RandomAgent"]
