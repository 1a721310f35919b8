"""How each agent looks in figures and on the page: its colour, marker and dashes, and its name in lines that fit."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence

# Okabe and Ito's colours, told apart with any colour vision; without their yellow, which is faint on white, and with a
# dark grey for their black, which is for means and intervals.
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#4d4d4d")
# As matplotlib calls them; charts.js has the same in the same order. With the colours they repeat after 84 agents.
MARKERS = "os^Dv<>PXp*h"
DASHES = ("-", "--", "-.")  # of the first agents with each colour, of the next, and of the others; dots are the paper's
# Of what the paper printed: one colour that no agent has, and strokes where agents have areas; charts.js has the same.
PAPER_COLOR = "#222222"
PAPER_MARKERS = {"MMN (paper)": "x", "MAH (paper)": "+", "DQN (paper)": "1", "Random (paper)": "2"}
_MOST_CHARACTERS = 120  # of a name in a figure
# Where a line may end: behind blanks and the marks in names, but not in numbers; in a longer word, before a capital.
_WORDS, _HUMPS = re.compile(r"(?<=[\s.:_/\\-])(?!\d)|(?<=\s)"), re.compile(r"(?<=[a-z0-9])(?=[A-Z])")


@dataclasses.dataclass(frozen=True)
class Look:
    """The look of one agent."""

    name: str
    place: int  # among all agents
    color: str
    marker: str
    dashes: str


def agent_looks(labels: Sequence[str]) -> dict[str, Look]:
    """Returns the look of each agent, by label; no two have one name, nor one colour, marker and dashes together."""
    looks = {}
    for place, (label, name) in enumerate(zip(labels, shorten(labels), strict=True)):
        turn, color = divmod(place, len(PALETTE))
        dashes = DASHES[min(turn, len(DASHES) - 1)]
        looks[label] = Look(name, place, PALETTE[color], MARKERS[place % len(MARKERS)], dashes)
    return looks


def shorten(labels: Sequence[str], most: int = _MOST_CHARACTERS) -> list[str]:
    """Returns the labels in about `most` characters: longer ones lose their middle, and get a number if alike."""
    half = most // 2
    names = [text if len(text) <= most else f"{text[:half]}…{text[-half:]}" for text in labels]
    return [
        name if names.count(name) == 1 else f"{name} ({1 + names[:place].count(name)})"
        for place, name in enumerate(names)
    ]


def wrap(text: str, width: int) -> str:
    """Returns `text` in lines of at most `width` characters, which end where words do if they can."""
    lines = [""]
    for word in _WORDS.split(text):
        parts = [word] if len(word.rstrip()) <= width else _HUMPS.split(word)
        for piece in (part[at : at + width] for part in parts for at in range(0, len(part), width)):
            if lines[-1] and len((lines[-1] + piece).rstrip()) > width:
                lines.append("")
            lines[-1] += piece
    return "\n".join(line.strip() for line in lines)
