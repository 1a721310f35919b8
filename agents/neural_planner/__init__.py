"""A learned agent with a planner in it: costs of cells, exact cheapest ways over them, and a policy that reads both."""

from .neural_planner import NeuralPlanner

__all__ = ["NeuralPlanner"]
