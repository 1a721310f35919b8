"""The paper's model-free agent that gets the context."""

from .mah import MAH, MAHPaper

__all__ = ["MAH", "MAHPaper"]
