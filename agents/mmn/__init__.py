"""MMN, after the paper: planning in a latent model, whose weights a hypermodel generates from the map."""

from .mmn import MMN, MMNPaths

__all__ = ["MMN", "MMNPaths"]
