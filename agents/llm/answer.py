"""An answer, as it is kept."""

from __future__ import annotations

import re
from typing import Annotated, Any

import pydantic

RESUME = "nothing is lost, go on with --resume"


def _replace_halves(text: Any) -> Any:
    """Returns a text without halves of UTF-16 pairs, which no file can hold."""
    return re.sub("[\ud800-\udfff]", "\ufffd", text) if isinstance(text, str) else text


_Text = Annotated[str, pydantic.BeforeValidator(_replace_halves)]


class Answer(pydantic.BaseModel):
    """A line of `answers.jsonl`; what the service did not tell is 0 or empty."""

    text: _Text
    model: _Text = ""  # as the service names it, perhaps more exactly than it was asked for
    finish_reason: _Text = ""
    input_tokens: int = 0
    output_tokens: int = 0  # thoughts included
    lost_tokens: int = 0  # the most that tries before it may have taken, whose replies were lost
    seconds: float = 0.0  # that it took
    prompt: str = ""  # SHA-256 of what was asked, sampling and seed
    pictures: tuple[str, ...] = ()  # SHA-256 of the pictures that were shown, by which files in `pictures` are named
    seed: int = 0  # of the question, as the next one
    decision: int = 0
    time: str = ""  # UTC
