"""The navigator: a classical agent that estimates its pose and the map from what its lidar measures."""

from .navigator import Navigator

__all__ = ["Navigator"]
