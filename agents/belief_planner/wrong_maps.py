"""Wrong maps of the train mazes, from which the belief learns: domain randomisation."""

from __future__ import annotations

import numpy as np

from mazebench.maps.maze import Cell
from mazebench.tasks.context import build_context
from mazebench.tasks.perturbations.base import ShownMap
from mazebench.tasks.perturbations.flip import flip
from mazebench.tasks.perturbations.warp import Perspective, random_homography
from mazebench.tasks.tracks.sketch import PIXELS, draw_by_hand
from mazebench.tasks.tracks.stale import move_doors, num_movable

from .belief import GOAL, NUM_PLANES, WALL
from .framing import framed

_SHARES = {"flips": 0.35, "doors": 0.2, "warp": 0.2, "sketch": 0.25}  # of the kinds among wrong maps
_LARGEST_FLIP = 0.25  # probability of a cell to be flipped, drawn from 0 to this
_MOST_DOORS = 12  # moved, drawn from 1 to this
_LARGEST_WARP = 0.22  # share of the side, drawn from 0 to this
_LARGEST_BEND = 1.5  # cells, drawn from 0 to this


def planes_of(walls: np.ndarray, goal: Cell) -> np.ndarray:
    """Returns a maze of `walls` `[M, M]` bool with its goal as `[2, M, M]` float32 (see `belief`)."""
    planes = np.zeros((NUM_PLANES, *walls.shape), dtype=np.float32)
    planes[WALL], planes[(GOAL, *goal)] = walls, 1
    return planes


def wrong_map(walls: np.ndarray, start: Cell, goal: Cell, rng: np.random.Generator) -> np.ndarray:
    """Draws a wrong map of a maze: with flipped cells or moved doors, seen in a wrong perspective, or drawn by hand.

    Args:
      walls: `[M, M]` bool, of the maze.
      start: where the episode begins.
      goal: where it leads.
      rng: the source of all draws.

    Returns:
      `[2, M, M]` float32, the map and the goal's mark.
    """
    size, kind = len(walls), rng.choice(list(_SHARES), p=list(_SHARES.values()))
    keep = {start, goal}
    most_doors = min(_MOST_DOORS, num_movable(walls) // 2) if kind == "doors" else 0
    if most_doors:
        return planes_of(move_doors(walls, int(rng.integers(1, most_doors + 1)), keep, rng), goal)
    if kind in ("flips", "doors"):
        return planes_of(flip(walls, rng.uniform(0, _LARGEST_FLIP), keep, rng), goal)
    if kind == "warp":
        shown = ShownMap(walls, Perspective(random_homography(size, rng.uniform(0, _LARGEST_WARP), rng)))
        pixels = size
    else:
        shown = ShownMap(walls, draw_by_hand(size, rng.uniform(0, _LARGEST_BEND), rng))
        pixels = PIXELS * size
    context = build_context(shown.seen_walls(), shown.seen_cell(start), shown.seen_cell(goal), pixels)
    return framed(context, size)[0]
