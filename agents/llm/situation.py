"""The prompt: what a model or a person is told of a moment, as text and as a picture.

`N` is the number of cells on a side of the shown map, in whose frame all is told.
"""

from __future__ import annotations

import hashlib
import math
import pathlib
from collections.abc import Iterable
from typing import NamedTuple

import cv2
import numpy as np

from mazebench.maps.maze import Cell
from mazebench.maps.pictures import draw_grid

from ..robot.cells import nearest_cell

# The version of the wording, and the beginning of the SHA-256 of this file.
WORDING = f"1-{hashlib.sha256(pathlib.Path(__file__).read_bytes()).hexdigest()[:12]}"
_INSTRUCTION = """\
You drive a robot through a building to a goal. You have one map of the building. The map may be wrong: since it was \
drawn, doors may have been walled up, and others broken through walls.
Reach the goal in as few steps as you can. Time runs while the robot drives, not while you think.
Cells are (row, column). Row 0 is the top (north) row, column 0 the left (west) one.

End your answer with one line, one of:
GO (r, c) (r, c) ...   drives to these cells in turn; each is in the row or the column of the one before it
GO north 3, east 2     drives so many cells; north, south, east and west
WAIT                   stays for a step
The robot asks again at the end of the route, and where it sees a wall on it{}. A line that can't be read or done \
costs a step."""
_TOLD = ", and when it sees something that differs from the map"
_PIXELS = 12  # of a cell's side in a picture
_NUMBERED = 5  # of so many rows and columns, one has its number in a picture
_POSE, _NUMBER = (230, 60, 200), (255, 210, 0)  # RGB


class Situation(NamedTuple):
    """A moment of an episode, and what is asked in it."""

    walls: np.ndarray  # [N, N] bool, the shown map
    start: Cell | None  # None where it is not marked
    goal: Cell
    seen: np.ndarray  # [N, N] int8: 1 where a wall was seen, -1 where a free cell was, 0 elsewhere
    pose: tuple[float, float, float]  # x and y (cells) and yaw (rad), as the robot estimates them
    certainty: float  # the probability that the map lies as the robot takes it to
    step: int  # of the episode, counted from 1
    told: bool  # whether it is told what differs from the map
    seed: int  # of the agent's draws in the episode, so that equal prompts of two episodes have answers of their own
    number: int = 0  # of the decision in the episode, counted from 1
    decisions: tuple[str, ...] = ()  # the last ones, with what came of them

    @property
    def here(self) -> Cell:
        """The cell of the robot."""
        return nearest_cell(*self.pose[:2], len(self.walls))

    @property
    def differing(self) -> np.ndarray:
        """The cells within the border in which something else was seen than the map shows, `[N, N]` bool."""
        differs = (self.seen != 0) & ((self.seen > 0) != self.walls)
        differs[[0, -1]] = differs[:, [0, -1]] = False
        return differs


def messages(situation: Situation) -> list[dict[str, str]]:
    """Returns what is asked as messages of a chat: the task and how to answer, and the situation."""
    texts = {"system": _INSTRUCTION.format(_TOLD if situation.told else ""), "user": prompt(situation)}
    return [{"role": role, "content": text} for role, text in texts.items()]


def prompt(situation: Situation) -> str:
    """Returns a situation as text. What does not change in an episode comes first, for services that cache it."""
    # The map.
    marks = np.where(situation.walls, "#", ".")
    if situation.start is not None:
        marks[situation.start] = "S"
    marks[situation.goal] = "G"
    lines = ["MAP (# wall, . free, S start, G goal)", *_grid(marks, 0, 0)]

    # The part of the building that was seen.
    seen = np.array(["?", "#", "."])[situation.seen]
    seen[situation.here] = "R"
    rows, columns = (np.flatnonzero((seen != "?").any(axis=1 - axis)) for axis in (0, 1))
    top, left, part = int(rows[0]), int(columns[0]), seen[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    lines += ["", f"SEEN SO FAR (# wall, . free, ? not seen, R robot) from column {left}", *_grid(part, top, left)]
    if situation.told:
        lines += ["", "SEEN, DIFFERENT FROM THE MAP"]
        for name, is_wall in (("Closed", True), ("Open", False)):
            cells = np.argwhere(situation.differing & ((situation.seen > 0) == is_wall)).tolist()
            lines.append(f"{name}: {', '.join(str(tuple(cell)) for cell in cells) or 'none'}")

    # The moment.
    facing = ("east", "north", "west", "south")[round(situation.pose[2] / (math.pi / 2)) % 4]
    lines += ["", "NOW", f"The robot is in cell {situation.here} and faces {facing}. The goal is {situation.goal}."]
    if situation.certainty < 0.99:
        lines.append(f"It is {situation.certainty:.0%} sure of where it is on the map.")
    lines += [f"Step {situation.step}.", "", "LAST DECISIONS"]
    return "\n".join([*lines, *(f"- {each}" for each in situation.decisions or ("none yet",))])


def picture(situation: Situation) -> np.ndarray:
    """Returns the map with start, goal and pose as a picture `[12 N, 12 N, 3]` uint8 RGB."""
    image = draw_grid(situation.walls, _PIXELS, situation.start, situation.goal)
    for number in range(0, len(situation.walls), _NUMBERED):
        for corner in ((number * _PIXELS, _PIXELS - 2), (0, (number + 1) * _PIXELS - 2)):
            cv2.putText(image, str(number), corner, cv2.FONT_HERSHEY_PLAIN, 0.7, _NUMBER)

    # The pose is an arrow of a cell and a half.
    x, y, yaw = situation.pose
    tail = np.array([x, len(situation.walls) - y]) * _PIXELS
    tip = tail + 1.5 * _PIXELS * np.array([math.cos(yaw), -math.sin(yaw)])
    cv2.arrowedLine(image, tail.astype(int).tolist(), tip.astype(int).tolist(), _POSE, 2, tipLength=0.4)
    return image


def _grid(marks: np.ndarray, top: int, left: int) -> Iterable[str]:
    """Yields the lines of marks `[H, W]`, with the numbers of columns, in two lines, and of rows."""
    columns = range(left, left + marks.shape[1])
    tens = [str(column // 10 % 10) if column % 10 == 0 or column == left else " " for column in columns]
    yield from (f"    {''.join(digits)}".rstrip() for digits in (tens, [str(column % 10) for column in columns]))
    for row, line in enumerate(marks, top):
        yield f"{row:3d} {''.join(line)}"
