"""A planner with a learned belief over the map and a learned driver."""

from .agent import BeliefPlanner

__all__ = ["BeliefPlanner"]
