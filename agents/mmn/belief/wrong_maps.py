"""Wrong maps of the train mazes, from which the belief learns: domain randomisation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mazebench.maps.maze import Cell
from mazebench.tasks.context import build_context
from mazebench.tasks.perturbations.base import ShownMap
from mazebench.tasks.perturbations.flip import flip
from mazebench.tasks.perturbations.warp import Perspective, random_homography
from mazebench.tasks.tracks.sketch import PIXELS, draw_by_hand
from mazebench.tasks.tracks.stale import move_doors, num_movable

from .belief import START
from .framing import framed

_SHARES = {"flips": 0.35, "doors": 0.2, "warp": 0.2, "sketch": 0.25}  # of the kinds among wrong maps
_LARGEST_FLIP = 0.25  # probability of a cell to be flipped, drawn from 0 to this
_MOST_DOORS = 12  # moved, drawn from 1 to this
_LARGEST_WARP = 0.22  # share of the side, drawn from 0 to this
_LARGEST_BEND = 1.5  # cells, drawn from 0 to this


class Drawn(NamedTuple):
    """A shown map; the cell (r, c) of the maze is looked for at (r, c) + `shift`."""

    shown: np.ndarray  # [3, M, M] float32; see `belief`
    shift: np.ndarray  # [2] int, by which the anchor's mark is displaced


def exact_map(walls: np.ndarray, start: Cell, goal: Cell) -> Drawn:
    """Returns the map of a maze as it is."""
    size = len(walls)
    return Drawn(framed(build_context(walls, start, goal, size), size), np.zeros(2, dtype=np.int64))


def wrong_map(walls: np.ndarray, start: Cell, goal: Cell, anchor: Cell, rng: np.random.Generator) -> Drawn:
    """Draws a wrong map of a maze: with flipped cells or moved doors, seen in a wrong perspective, or drawn by hand.

    Args:
      walls: `[M, M]` bool, of the maze.
      start, goal: what the map marks.
      anchor: the cell from which displacements are measured.
      rng: the source of all draws.
    """
    size, kind = len(walls), rng.choice(list(_SHARES), p=list(_SHARES.values()))
    keep = {start, goal}
    most_doors = min(_MOST_DOORS, num_movable(walls) // 2) if kind == "doors" else 0
    if most_doors:
        return exact_map(move_doors(walls, int(rng.integers(1, most_doors + 1)), keep, rng), start, goal)
    if kind in ("flips", "doors"):
        return exact_map(flip(walls, rng.uniform(0, _LARGEST_FLIP), keep, rng), start, goal)
    if kind == "warp":
        shown = ShownMap(walls, Perspective(random_homography(size, rng.uniform(0, _LARGEST_WARP), rng)))
        pixels = size
    else:
        shown = ShownMap(walls, draw_by_hand(size, rng.uniform(0, _LARGEST_BEND), rng))
        pixels = PIXELS * size
    picture = shown.seen_walls()
    marks = [shown.seen_cell(cell) for cell in (start, goal, anchor)]
    context = build_context(picture, marks[0], marks[1], pixels)
    # The anchor was the marked start of an earlier context; its mark is framed like the goal's.
    earlier = build_context(picture, marks[2], marks[1], pixels)
    row, column = divmod(int(framed(earlier, size)[START].argmax()), size)
    return Drawn(framed(context, size), np.array([row - anchor[0], column - anchor[1]]))
