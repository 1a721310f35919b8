"""The believer: a navigator that believes that doors have moved and walls have not."""

from .believer import Believer

__all__ = ["Believer"]
