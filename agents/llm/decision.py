"""The grammar of decisions: what the last command of an answer means."""

from __future__ import annotations

import re
from typing import NamedTuple

from mazebench.errors import shortened
from mazebench.maps.maze import Cell

_STEPS = {"north": (-1, 0), "south": (1, 0), "east": (0, 1), "west": (0, -1)}  # rows, columns
# A command is in capitals, or stands at the beginning of a line.
_COMMAND = re.compile(r"(?:^\W*(?i:(GO|WAIT))\b|\b(GO|WAIT)\b)(.*)$", re.M)
_LEG = re.compile(r"\(\s*(-?\d{1,4})\s*,\s*(-?\d{1,4})\s*\)|\b(north|south|east|west)\b\s*(\d{1,4})?", re.I)
_LONGEST = 80  # characters of a decision when it is quoted


class Decision(NamedTuple):
    """A decision as it was read."""

    said: str  # the command, or the end of an answer without one
    route: tuple[Cell, ...] = ()  # the cells to drive through, the first one that of the robot; none to stay for a step
    fault: str = ""  # the reason for which the answer can't be read or done


def read_decision(answer: str, here: Cell, size: int) -> Decision:
    """Returns the decision in any text, for a robot in the cell `here` of a map of `size` cells a side."""
    found = [*_COMMAND.finditer(answer)]
    if not found:
        return Decision(" ".join(answer.split())[-_LONGEST:] or "(nothing)", fault="no line with GO or WAIT was found")
    word, rest = (found[-1][1] or found[-1][2]).upper(), found[-1][3]
    said, route = shortened(word + rest, _LONGEST), [here]
    if word == "WAIT":
        return Decision(said)
    for r, c, direction, count in _LEG.findall(rest):
        # The cell in which the leg ends, and those on the way to it.
        (row, column), (down, right) = route[-1], _STEPS.get(direction.lower(), (0, 0))
        end = (row + down * int(count or 1), column + right * int(count or 1)) if direction else (int(r), int(c))
        if not (0 <= end[0] < size and 0 <= end[1] < size):
            return Decision(said, fault=f"{end} is outside of the map")
        if end[0] != row and end[1] != column:
            return Decision(said, fault=f"{end} is not in the row or column of {route[-1]}")
        while (row, column) != end:
            row, column = row + (end[0] > row) - (end[0] < row), column + (end[1] > column) - (end[1] < column)
            route.append((row, column))
    return Decision(said, tuple(route)) if len(route) > 1 else Decision(said, fault="it names no other cell")
