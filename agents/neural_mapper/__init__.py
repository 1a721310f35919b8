"""A learned agent with a memory: a network writes a map of what its lidar shows, and it drives by that."""

from .neural_mapper import NeuralMapper

__all__ = ["NeuralMapper"]
