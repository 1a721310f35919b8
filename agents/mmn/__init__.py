"""MMN: planning in a latent model, whose weights a hypermodel generates from the map."""

from .mmn import MMN, MMNPaper

__all__ = ["MMN", "MMNPaper"]
