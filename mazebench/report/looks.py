"""How each agent looks in figures and on the page: its colour, marker, line, order, and its name in lines that fit."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence

# Okabe and Ito's colours, told apart with any colour vision; without their yellow, which is faint on white, and with a
# dark grey for their black, which is for means and intervals.
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#4d4d4d")
# As matplotlib calls them. With the colours they repeat after 84 agents.
MARKERS = "os^Dv<>PXp*h"
# Of the first agents with each colour, of the next, and of the others; dots are the paper's.
DASHES = ((), (3.7, 1.6), (6.4, 1.6, 1.0, 1.6))
# Of what the paper printed: one colour that no agent has, and strokes where agents have areas.
PAPER_COLOR, PAPER_DOTS = "#222222", (1.0, 1.65)
PAPER_MARKERS = {"MMN (paper)": "x", "MAH (paper)": "+", "DQN (paper)": "1", "Random (paper)": "2"}
MEAN = "mean, 95 % interval"  # the label of means in violins
MEAN_COLOR = "#000000"
# Where paper is dark, these colours of what is written on it are light.
INKS = (PALETTE[-1], PAPER_COLOR, MEAN_COLOR)
_MOST_CHARACTERS = 120  # of a name in a figure
# Where a line may end: behind blanks and the marks in names, but not in numbers; in a longer word, before a capital.
_WORDS, _HUMPS = re.compile(r"(?<=[\s.:_/\\-])(?!\d)|(?<=\s)"), re.compile(r"(?<=[a-z0-9])(?=[A-Z])")


@dataclasses.dataclass(frozen=True)
class Look:
    """The look of one agent, or of what the paper printed of it."""

    name: str
    color: str
    marker: str  # as matplotlib calls it
    dashes: tuple[float, ...]  # of the line, in its widths: what is drawn, what is left out, and so on; () is unbroken
    width: float  # pt, of the line
    size: float  # pt, of the marker


def all_looks(labels: Sequence[str]) -> dict[str, Look]:
    """Returns the look of each agent, by label, in the order of legends; then those of the paper's values and of means.

    No two agents have one name, nor one colour, marker and dashes together. The later an agent is drawn, the finer its
    line: where two agree, both are seen.
    """
    looks = {}
    for index, (label, name) in enumerate(zip(labels, shorten(labels), strict=True)):
        turn, rank = divmod(index, len(PALETTE))
        dashes, marker = DASHES[min(turn, len(DASHES) - 1)], MARKERS[index % len(MARKERS)]
        looks[label] = Look(name, PALETTE[rank], marker, dashes, 1.8 - 0.15 * rank, 4.8 - 0.35 * rank)
    for label, marker in PAPER_MARKERS.items():
        looks[label] = Look(label, PAPER_COLOR, marker, PAPER_DOTS, width=0.9, size=5.5)
    return looks | {MEAN: Look(MEAN, MEAN_COLOR, "o", (), width=1.2, size=3.0)}


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
