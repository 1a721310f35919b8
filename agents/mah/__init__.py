"""The paper's model-free agent that gets the context."""

from .agent import MAH, MAHPaper

__all__ = ["MAH", "MAHPaper"]
