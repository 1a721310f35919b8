"""The map policy, which reads map and picture by a network alone."""

from .map_policy import MapPolicy

__all__ = ["MapPolicy"]
