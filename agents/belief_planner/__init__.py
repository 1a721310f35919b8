"""The belief planner: a robot whose belief of walls and goal is learned."""

from .agent import BeliefPlanner

__all__ = ["BeliefPlanner"]
