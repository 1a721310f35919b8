"""The paper's own agent: planning in a latent model whose weights a hypermodel predicts from the map."""

from .mmn import MMN

__all__ = ["MMN"]
