"""The navigator: a classical agent that estimates its pose and the map from what its lidar measures, or by touch."""

from .navigator import BeliefRule, Navigator

__all__ = ["BeliefRule", "Navigator"]
