"""The paper's hard-coded strategy, and one that corrects itself all the time."""

from .closed_loop import ClosedLoopPlanner
from .planner import Planner

__all__ = ["ClosedLoopPlanner", "Planner"]
