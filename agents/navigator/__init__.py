"""The navigator: a classical agent that localizes itself and corrects its map by lidar, or by touch."""

from .navigator import Navigator
from .references import NavigatorTold, NavigatorWithoutMemory, NavigatorWithoutWaiting

__all__ = ["Navigator", "NavigatorTold", "NavigatorWithoutMemory", "NavigatorWithoutWaiting"]
