"""A classical robot as Nav2 runs it: a layered costmap, a global planner, and a dynamic window of velocities."""

from .costmap_dwa import CostmapDWA

__all__ = ["CostmapDWA"]
