"""The cost of the questions of a run, estimated before any is asked."""

from __future__ import annotations

import numpy as np

from .situation import EGOCENTRIC, NUM_VIEWS, Situation, View, picture, question

QUESTIONS = 10  # in an episode: the mean of the three scripts on `llm-dev`
_CHARACTERS = 2.2  # of a prompt for each token, as SmolLM2 reads it
_PIXELS = 750  # of a picture for each token; services count them in many ways
_DECISIONS = 3  # that a prompt quotes
_VIEW = View(np.zeros((180, 768, 3), dtype=np.uint8), step=1, cell=(1, 1), facing="")


def input_tokens(see: str, told: bool, size: int) -> int:
    """Returns the tokens of a prompt, about, of which half of a building of `size` cells a side was seen."""
    seen = np.zeros((size, size), dtype=np.int8)
    seen[: size // 2] = -1
    walls, pose, made = seen == 0, (1.5, size - 1.5, 0.0), ("GO (1, 1) (1, 9): done",) * _DECISIONS
    views = (_VIEW,) * NUM_VIEWS if see == EGOCENTRIC else ()
    situation = Situation(walls, None, (1, 2), seen, pose, 1.0, 1, told, 0, 1, made, see, views)
    asked = question(situation)
    pixels = picture(situation)[..., 0].size * bool(asked.pictures) + _VIEW.picture[..., 0].size * len(views)
    return round((len(asked.instruction) + len(asked.text)) / _CHARACTERS + pixels / _PIXELS)
