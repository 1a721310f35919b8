"""Agents that plan on a map: the paper's hard-coded strategy, one that corrects its course, and the oracle."""

from .closed_loop import ClosedLoopPlanner
from .oracle import Oracle
from .planner import Planner

__all__ = ["ClosedLoopPlanner", "Oracle", "Planner"]
