"""Agents that plan on a map: the paper's hard-coded strategy, one that corrects its course, and the oracle."""

from .closed_loop import ClosedLoopPlanner
from .oracle import HurryingOracle, Oracle, WaitingDriver
from .planner import Planner

__all__ = ["ClosedLoopPlanner", "HurryingOracle", "Oracle", "Planner", "WaitingDriver"]
