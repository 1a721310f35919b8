"""A policy that reads picture and map, without senses written by hand."""

from .map_policy import MapPolicy

__all__ = ["MapPolicy"]
