"""The grammar of decisions: what the last command of an answer means."""

from __future__ import annotations

import re
from typing import NamedTuple

from mazebench.errors import shortened
from mazebench.maps.maze import Cell

_STEPS = {"north": (-1, 0), "south": (1, 0), "east": (0, 1), "west": (0, -1)}  # rows, columns
# A command is in capitals, or stands at the beginning of a line.
_COMMAND = re.compile(r"(?:^[^\w\n]*(?i:(GO|WAIT))\b|\b(GO|WAIT)\b)(.*)$", re.M)
_DIRECTION = r"(?<![^\W\d_])(north|south|east|west)(?![^\W\d_])"
_LEG = re.compile(
    r"\( ?(-?\d{1,30}) ?, ?(-?\d{1,30}) ?\)"  # a cell
    rf"|(?<![\w.+-])(\d{{1,30}}) ?(?:cells?|steps?)? ?{_DIRECTION}"  # 3 north
    rf"|{_DIRECTION}(?: ?[:=]? ?\+?(\d{{1,30}}))?",  # north 3, north: 3, north
    re.I,
)
_TAG = re.compile(r"<[^<>]{0,40}>")
_WORD = re.compile(r"[-+.]?[^\W_]+")
_FILLERS = {"and", "cell", "cells", "step", "steps", "then", "to"}
_THOUGHT = re.compile(r"<(/?)think(?:ing)?>|\[(/?)THINK\]", re.I)  # the ends of what a model thinks aloud
_LONGEST = 80  # characters of a decision when it is quoted

# Why an answer holds no decision, with the reasons that services give.
CUT, FILTERED, WITHOUT_TEXT = "cut", "filtered", "without_text"
_REASONS = {"length": CUT, "max_tokens": CUT, "max_output_tokens": CUT, "model_length": CUT}
_REASONS |= dict.fromkeys(("content_filter", "prohibited_content", "recitation", "refusal", "safety"), FILTERED)
_FAULTS = {CUT: "the answer was cut before its end", FILTERED: "the service filtered the answer"}


class Decision(NamedTuple):
    """A decision as it was read."""

    said: str  # the command, or the end of an answer without one
    route: tuple[Cell, ...] = ()  # the cells to drive through, the first one that of the robot; none to stay for a step
    fault: str = ""  # the reason for which the answer can't be read or done
    flaw: str = ""  # `CUT`, `FILTERED` or `WITHOUT_TEXT` of an answer that holds no decision


def read_decision(answer: str, here: Cell, size: int, finish_reason: str = "") -> Decision:
    """Returns the decision in any text, for a robot in the cell `here` of a map of `size` cells a side.

    `finish_reason` is why the text ends, as services tell it. Thoughts do not count. Of a text that was cut, a command
    counts only if it is a whole line, the last one.
    """
    marks = [*_THOUGHT.finditer(answer)]
    is_thought = bool(marks) and not (marks[-1][1] or marks[-1][2])
    text = answer[marks[-1].end() :] if marks and not is_thought else answer
    found = [*_COMMAND.finditer(text)]
    is_whole = bool(found) and text[found[-1].end() :].isspace() and not is_thought
    flaw = CUT if is_thought else _REASONS.get(finish_reason.lower(), "" if text.strip() else WITHOUT_TEXT)
    if (flaw and not is_whole) or not found:
        said = " ".join(text.split())[-_LONGEST:] or "(nothing)"
        return Decision(said, fault=_FAULTS.get(flaw, "no line with GO or WAIT was found"), flaw=flaw)
    word, rest = (found[-1][1] or found[-1][2]).upper(), found[-1][3]
    said, rest = shortened(word + rest, _LONGEST), _TAG.sub(" ", " ".join(rest.split()))
    if word == "WAIT":
        numbers = [number for number in re.findall(r"\d+", rest) if number != "1"]
        return Decision(said, fault=f"it waits for one step, not {numbers[0][:20]}" if numbers else "")
    return _read_route(said, rest, here, size)


def _read_route(said: str, rest: str, here: Cell, size: int) -> Decision:
    """Returns the decision to drive as the rest of a command says."""
    unread = [word for word in _WORD.findall(_LEG.sub(" ", rest)) if word.lower() not in _FILLERS]
    if unread:
        return Decision(said, fault=f"{unread[0][:20]!r} can't be read")
    route = [here]
    for r, c, before, heading, direction, after in _LEG.findall(rest):
        # The cell in which the leg ends, and those on the way to it.
        way, count = (heading or direction).lower(), int(before or after or 1)
        (row, column), (down, right) = route[-1], _STEPS.get(way, (0, 0))
        end = (row + down * count, column + right * count) if way else (int(r), int(c))
        if not (0 <= end[0] < size and 0 <= end[1] < size):
            return Decision(said, fault=f"{end} is outside of the map")
        if end[0] != row and end[1] != column:
            return Decision(said, fault=f"{end} is not in the row or column of {route[-1]}")
        while (row, column) != end:
            row, column = row + (end[0] > row) - (end[0] < row), column + (end[1] > column) - (end[1] < column)
            route.append((row, column))
    return Decision(said, tuple(route)) if len(route) > 1 else Decision(said, fault="it names no other cell")
