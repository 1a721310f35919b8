"""Maps to learn from: right ones, wrong ones, and ones of which it is unknown where they lie.

`N` is the number of cells on a side of a layout, `L` of the grid on which the robot keeps what it knows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import ndimage

from mazebench.errors import InputError
from mazebench.maps.doors import swap_doors
from mazebench.maps.kinds.base import door_slots
from mazebench.maps.maze import Cell, cell_to_point
from mazebench.tasks.context import LOCAL_MAP, START, build_context
from mazebench.tasks.perturbations.base import ShownMap
from mazebench.tasks.perturbations.flip import flip
from mazebench.tasks.perturbations.warp import Perspective, random_homography

from ..robot.map_matching import MapBelief, orientations
from ..robot.map_reading import MapReading, read_map
from .layouts import change

# What is wrong with maps, and the share of each. Many are right, so that a right map is not doubted. No task shows maps
# that are "changed" or "bent": they keep the network from knowing flips, moved doors and warps only.
SHARES = {"right": 0.3, "doors": 0.25, "flips": 0.14, "warp": 0.15, "changed": 0.08, "bent": 0.08}
_TURNED = 0.08  # share of maps that are on a sheet that may be turned or mirrored, in the pose's frame
_LARGEST_FLIP = 0.25  # probability of a cell to be flipped, drawn from 0 to this
_LARGEST_WARP = 0.22  # share of the side, drawn from 0 to this
_MOST_CHANGES = 6  # things that were built or torn down since the map was made
_LARGEST_BEND = 2.0  # cells by which a map is bent that was read from a drawing; the reading is wrong by less
_UNKNOWN = 0.04  # share of maps that show nothing but start and goal
_CERTAIN = 0.98  # probability of a wall that a drawing shows


class Situation(NamedTuple):
    """What a robot finds before it moves, on the grid of what it will see; and the truth."""

    walls: np.ndarray  # [L, L] bool, the true ones; outside of the maze is wall
    start: Cell
    goal: Cell
    belief: MapBelief  # of how the sheet lies on the grid
    wrong: str  # what is wrong with the map, of `SHARES`


def draw_situation(walls: np.ndarray, is_lost: bool, rng: np.random.Generator) -> Situation:
    """Draws start, goal and a map of a layout `walls` `[N, N]` bool; if `is_lost`, the place on the map is unknown."""
    size = len(walls)
    free = np.argwhere(~walls)
    start, goal = (tuple(cell) for cell in free[rng.choice(len(free), 2, replace=False)].tolist())
    wrong = str(rng.choice(list(SHARES), p=list(SHARES.values())))
    reading = _reading(walls, (start, goal), wrong, hides_start=is_lost and rng.random() < 0.7, rng=rng)
    wrong = wrong if wrong != "doors" or not np.array_equal(reading.walls > 0.5, walls) else "right"
    if not is_lost:
        num_turns = 8 if rng.random() < _TURNED else 1
        belief = MapBelief.begin(reading.walls, reading.goal, num_turns, None, size)
        turn = int(rng.integers(num_turns))
        return Situation(*_turned(walls, start, goal, turn), belief, wrong)

    # The grid has the start in its middle; its axes may be turned against the sheet.
    num_turns = int(rng.choice([1, 8]))
    belief = MapBelief.begin(reading.walls, reading.goal, num_turns, reading.start, 2 * size - 1)
    turned, start, goal = _turned(walls, start, goal, int(rng.integers(num_turns)))
    grid = np.ones((2 * size - 1, 2 * size - 1), dtype=bool)
    top, left = size - 1 - start[0], size - 1 - start[1]
    grid[top : top + size, left : left + size] = turned
    return Situation(grid, (size - 1, size - 1), (goal[0] + top, goal[1] + left), belief, wrong)


def _reading(
    walls: np.ndarray, ends: tuple[Cell, Cell], wrong: str, hides_start: bool, rng: np.random.Generator
) -> MapReading:
    """Returns what a robot reads from a map of a layout `walls` `[N, N]` bool, with something wrong."""
    size = len(walls)
    point = None if hides_start else tuple(cell_to_point(ends[0], size).tolist())
    if wrong == "bent":
        return _bent(walls, ends, hides_start, rng)
    shown = ShownMap(walls)
    if wrong == "doors":
        shown = ShownMap(_moved_doors(walls, ends, rng))
    elif wrong == "flips":
        shown = ShownMap(flip(walls, rng.uniform(0, _LARGEST_FLIP), ends, rng))
    elif wrong == "warp":
        shown = ShownMap(walls, Perspective(random_homography(size, rng.uniform(0, _LARGEST_WARP), rng)))
    elif wrong == "changed":
        shown = ShownMap(_changed(walls, ends, rng))
    start, goal = (shown.seen_cell(cell) for cell in ends)
    context = build_context(shown.seen_walls(), start, goal, size)
    if hides_start:
        context[[LOCAL_MAP, START]] = 0
    if rng.random() < _UNKNOWN:
        context[:2] = 0
    return read_map(context, size, point)


def _moved_doors(walls: np.ndarray, ends: tuple[Cell, Cell], rng: np.random.Generator) -> np.ndarray:
    """Returns the walls of a map on which few or many doors have moved; the same walls if none can move."""
    slots = door_slots(walls)
    is_closed = walls[tuple(slots.T)]
    num_swaps = int(np.exp(rng.uniform(0, np.log(max(1, min(is_closed.sum(), (~is_closed).sum()))))))
    while num_swaps:
        try:
            return swap_doors(walls, slots, num_swaps, ends, rng)
        except InputError:  # too many, for a door moves but once
            num_swaps //= 2
    return walls


def _changed(walls: np.ndarray, ends: tuple[Cell, Cell], rng: np.random.Generator) -> np.ndarray:
    """Returns the walls of a map in some area of which something was built or torn down."""
    changed, where = walls.copy(), rng.integers(0, len(walls), size=4)
    for _ in range(rng.integers(1, _MOST_CHANGES + 1)):
        change(changed, rng)
    top, bottom, left, right = *np.sort(where[:2]), *np.sort(where[2:])
    shown = walls.copy()
    shown[top : bottom + 1, left : right + 1] = changed[top : bottom + 1, left : right + 1]
    shown[[0, -1]] = shown[:, [0, -1]] = True
    shown[tuple(np.transpose(ends))] = False
    return shown


def _bent(walls: np.ndarray, ends: tuple[Cell, Cell], hides_start: bool, rng: np.random.Generator) -> MapReading:
    """Returns a reading like that of a drawing by hand, which `read_map` takes too long to read.

    The map is bent smoothly, and the reading is unsure where walls are by some share of a cell.
    """
    size = len(walls)
    bend = ndimage.gaussian_filter(rng.standard_normal((2, size, size)), (0, 3.0, 3.0))
    bend *= rng.uniform(0, _LARGEST_BEND) / np.sqrt((bend**2).sum(axis=0)).max()
    bend -= bend[:, ends[0][0], ends[0][1]][:, None, None] * (rng.random() < 0.5)  # the start is where it is shown
    unsure = rng.uniform(0.2, 0.8)
    share = ndimage.map_coordinates(walls.astype(float), np.indices(walls.shape) + bend, order=1, mode="nearest")
    shown = (1 - _CERTAIN) + (2 * _CERTAIN - 1) * ndimage.gaussian_filter(share, unsure, mode="nearest")
    shown[[0, -1]] = shown[:, [0, -1]] = 1.0
    marks = []
    for cell, is_hidden in zip(ends, (hides_start, False), strict=True):
        mark = np.zeros(walls.shape)
        mark[tuple(np.clip(np.rint(cell - bend[:, cell[0], cell[1]]), 1, size - 2).astype(int))] = 1.0
        mark = np.ones(walls.shape) if is_hidden else ndimage.gaussian_filter(mark, unsure)
        marks.append(mark * (1 - shown) / (mark * (1 - shown)).sum())
    if not hides_start:
        marks[0] = np.zeros(walls.shape)
        marks[0][ends[0]] = 1.0
    return MapReading(shown, *marks)


def _turned(walls: np.ndarray, start: Cell, goal: Cell, turn: int) -> tuple[np.ndarray, Cell, Cell]:
    """Returns walls `[N, N]` bool and two of its cells in one of the orientations of `orientations`."""
    planes = [walls]
    for cell in (start, goal):
        planes.append(np.zeros_like(walls))
        planes[-1][cell] = True
    walls, *marks = (orientations(plane, turn + 1)[turn] for plane in planes)
    first, second = (divmod(int(mark.argmax()), len(walls)) for mark in marks)
    return walls, first, second
