"""MMN: planning in a latent model, whose weights a hypermodel generates from the map."""

from .belief.agent import MMN
from .mmn import MMNPaper

__all__ = ["MMN", "MMNPaper"]
