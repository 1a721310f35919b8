"""The prompt: what a model or a person is told of a moment, as text and as pictures.

`N` is the number of cells on a side of the shown map, in whose frame all is told.
"""

from __future__ import annotations

import base64
import hashlib
import json
import math
import pathlib
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from mazebench.maps.maze import Cell

from ..robot.cells import nearest_cell
from . import pictures
from .pictures import draw_map, to_png

TEXT, MAP, BOTH, EGOCENTRIC = SEES = ("text", "map", "both", "egocentric")  # how a model is shown a situation
NUM_VIEWS = 4  # of the camera, that a prompt shows at most

_FILES = (pathlib.Path(__file__), pathlib.Path(pictures.__file__))
# The version of the wording, and the beginning of the SHA-256 of the files that make prompts.
WORDING = f"2-{hashlib.sha256(b''.join(path.read_bytes() for path in _FILES)).hexdigest()[:12]}"
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
_MAP_PICTURE = """\
MAP (picture 1)
Each square is a cell, and the numbers at the border are those of rows and columns. Black is wall, white is free{}, \
and the red disc is the goal. The magenta disc is the robot, whose arrow shows where it faces."""
_SEEN_PICTURE = """\
A small square in a cell tells what was seen there so far: orange a wall, light blue a free cell. In a cell without \
one, nothing was seen."""
_ALL_ROUND = """\
Each picture shows all that is around the robot, its left edge and its right edge the south."""


class View(NamedTuple):
    """The view of the robot's camera in a moment."""

    picture: np.ndarray  # [H, W, 3] uint8 RGB
    step: int
    cell: Cell
    facing: str  # empty for a view all round


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
    see: str = TEXT  # of `SEES`
    views: tuple[View, ...] = ()  # for `EGOCENTRIC`: the present one, and the last ones before

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


class Question(NamedTuple):
    """The question that is asked in a situation."""

    instruction: str  # the task and how to answer
    text: str
    pictures: tuple[bytes, ...]  # PNG

    @property
    def messages(self) -> list[dict[str, Any]]:
        """The question as messages of a chat."""
        parts: list[dict[str, Any]] = [{"type": "text", "text": self.text}]
        for png in self.pictures:
            url = f"data:image/png;base64,{base64.b64encode(png).decode()}"
            parts.append({"type": "image_url", "image_url": {"url": url}})
        content = parts if self.pictures else self.text
        return [{"role": "system", "content": self.instruction}, {"role": "user", "content": content}]


def question(situation: Situation) -> Question:
    """Returns what is asked in a situation, as its `see` has it."""
    instruction = _INSTRUCTION.format(_TOLD if situation.told else "")
    if situation.see == TEXT:
        return Question(instruction, prompt(situation), ())
    shows_seen = situation.see != EGOCENTRIC
    about_map = [_MAP_PICTURE.format(", the green disc is the start" if situation.start is not None else "")]
    about_map += [_SEEN_PICTURE] * shows_seen
    grids = [*_map_grid(situation), "", *_seen_grid(situation), ""] if situation.see == BOTH else []
    lines = [*grids, *about_map, *_moment(situation)]
    images = [picture(situation, shows_seen)]
    if situation.views:
        lines += ["", "CAMERA"]
        for number, view in enumerate(situation.views, 2):
            when = "now" if number == 2 else f"in step {view.step}"
            facing = f", which faces {view.facing}" if view.facing else ""
            lines.append(f"Picture {number}: {when}, from cell {view.cell}{facing}.")
            images.append(view.picture)
        lines += [_ALL_ROUND] * (not situation.views[0].facing)
    return Question(instruction, "\n".join(lines), tuple(map(to_png, images)))


def key_of(situation: Situation, sampling: dict[str, Any]) -> str:
    """Returns the SHA-256 of a question, its sampling and its seed, by which its answer is known.

    Pictures count by what they show, since other versions of a library may draw or pack them otherwise.
    """
    texts = question(situation._replace(see=TEXT))
    asked: list[Any] = [texts.messages, sampling, situation.seed]
    if situation.see != TEXT:
        asked += [situation.see, [hashlib.sha256(view.picture.tobytes()).hexdigest() for view in situation.views]]
    return hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()


def prompt(situation: Situation) -> str:
    """Returns a situation as text. What does not change in an episode comes first, for services that cache it."""
    return "\n".join([*_map_grid(situation), "", *_seen_grid(situation), *_moment(situation)])


def picture(situation: Situation, shows_seen: bool = False) -> np.ndarray:
    """Returns the map with start, goal and pose, and perhaps with what was seen, as `draw_map` draws it."""
    seen = situation.seen if shows_seen else None
    return draw_map(situation.walls, situation.start, situation.goal, situation.pose, seen)


def facing(yaw: float) -> str:
    """Returns the direction that is nearest to a heading (rad)."""
    return ("east", "north", "west", "south")[round(yaw / (math.pi / 2)) % 4]


def _map_grid(situation: Situation) -> list[str]:
    """Returns the map as lines."""
    marks = np.where(situation.walls, "#", ".")
    if situation.start is not None:
        marks[situation.start] = "S"
    marks[situation.goal] = "G"
    return ["MAP (# wall, . free, S start, G goal)", *_grid(marks, 0, 0)]


def _seen_grid(situation: Situation) -> list[str]:
    """Returns the part of the building that was seen as lines."""
    seen = np.array(["?", "#", "."])[situation.seen]
    seen[situation.here] = "R"
    rows, columns = (np.flatnonzero((seen != "?").any(axis=1 - axis)) for axis in (0, 1))
    top, left, part = int(rows[0]), int(columns[0]), seen[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    return [f"SEEN SO FAR (# wall, . free, ? not seen, R robot) from column {left}", *_grid(part, top, left)]


def _moment(situation: Situation) -> list[str]:
    """Returns what differs, if that is told, the moment and the last decisions as lines."""
    lines = []
    if situation.told:
        lines += ["", "SEEN, DIFFERENT FROM THE MAP"]
        for name, is_wall in (("Closed", True), ("Open", False)):
            cells = np.argwhere(situation.differing & ((situation.seen > 0) == is_wall)).tolist()
            lines.append(f"{name}: {', '.join(str(tuple(cell)) for cell in cells) or 'none'}")
    faces = facing(situation.pose[2])
    lines += ["", "NOW", f"The robot is in cell {situation.here} and faces {faces}. The goal is {situation.goal}."]
    if situation.certainty < 0.99:
        lines.append(f"It is {situation.certainty:.0%} sure of where it is on the map.")
    lines += [f"Step {situation.step}.", "", "LAST DECISIONS"]
    return [*lines, *(f"- {each}" for each in situation.decisions or ("none yet",))]


def _grid(marks: np.ndarray, top: int, left: int) -> Iterable[str]:
    """Yields the lines of marks `[H, W]`, with the numbers of columns, in two lines, and of rows."""
    columns = range(left, left + marks.shape[1])
    tens = [str(column // 10 % 10) if column % 10 == 0 or column == left else " " for column in columns]
    yield from (f"    {''.join(digits)}".rstrip() for digits in (tens, [str(column % 10) for column in columns]))
    for row, line in enumerate(marks, top):
        yield f"{row:3d} {''.join(line)}"
