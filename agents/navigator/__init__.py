"""The navigator: a classical agent that localizes itself and corrects its map by lidar, or by touch."""

from .navigator import Navigator

__all__ = ["Navigator"]
