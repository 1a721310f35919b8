"""Scripted drivers, which read nothing but the prompt and answer in its grammar: references for a model's results."""

from __future__ import annotations

import itertools
import math
import re

import numpy as np

from ..robot.planning import cheapest_ways

_HOPE = 10.0  # cells; what a wall of the map costs that was not seen


def bfs(text: str) -> str:
    """Never revises: takes a shortest path on the map, whatever was seen."""
    return _answer(text, np.where(_marks(text, "MAP") == "#", math.inf, 1.0)) or "WAIT"


def told(text: str) -> str:
    """Takes into the map what it is told; where that leaves no way, it takes one on the map as it is drawn."""
    cost = np.where(_marks(text, "MAP") == "#", math.inf, 1.0)
    for name, cells in re.findall(r"^(Closed|Open): (.*)$", text, re.M):
        for row, column in re.findall(r"(\d+), (\d+)", cells):
            cost[int(row), int(column)] = math.inf if name == "Closed" else 1.0
    return _answer(text, cost) or bfs(text)


def hope(text: str) -> str:
    """Takes what was seen as it is, and hopes that walls of the map that were not seen are doors, at a cost."""
    cost, seen = np.where(_marks(text, "MAP") == "#", 1.0 + _HOPE, 1.0), _marks(text, "SEEN SO FAR")
    cost[(seen == ".") | (seen == "R")] = 1.0
    cost[seen == "#"] = cost[[0, -1]] = cost[:, [0, -1]] = math.inf
    return _answer(text, cost) or "WAIT"


SCRIPTS = {"bfs": bfs, "told": told, "hope": hope}


def _marks(text: str, title: str) -> np.ndarray:
    """Returns `[N, N]` characters: a grid of the prompt in its place on the map, "?" where it does not reach."""
    blocks = {block.partition(" (")[0]: block.split("\n") for block in text.split("\n\n")}
    marks = np.full((len(blocks["MAP"]) - 3,) * 2, "?")
    head, _, _, *lines = blocks[title]
    left = int(head.partition("from column ")[2] or 0)
    for line in lines:
        marks[int(line[:3]), left : left + len(line) - 4] = list(line[4:])
    return marks


def _answer(text: str, cost: np.ndarray) -> str:
    """Returns the command to drive the cheapest way to the goal, by what entering each cell costs; "" without one."""
    is_goal = _marks(text, "MAP") == "G"
    following = cheapest_ways(cost, np.where(is_goal, 0.0, math.inf)).tolist()
    way = [int(np.argmax(_marks(text, "SEEN SO FAR") == "R"))]
    while following[way[-1]] != way[-1]:
        way.append(following[way[-1]])
    if not is_goal.flat[way[-1]] or len(way) == 1:
        return ""
    moves = [after - before for before, after in itertools.pairwise(way)]
    corners = [cell for cell, a, b in zip(way[1:], moves, [*moves[1:], None], strict=True) if a != b]
    return "GO " + " ".join(str(divmod(cell, len(cost))) for cell in corners)
