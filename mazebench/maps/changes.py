"""Buildings in which things have changed since their map was drawn.

The maze that is given is the old map, here called the plan. In a changed building, open passages are closed, walled
ones are opened, and furniture has come and gone. The strength of the changes is their cost to a robot on the grid that
believes the plan: an episode is late if the robot drives over 1.25 times the shortest way. All that is drawn and
compared are whole numbers and their ratios, so that one seed gives one building on every machine.

`P` is the number of pairs of a start and a goal, `Q` of passages of the plan, and `N` of rows and columns.
"""

from __future__ import annotations

import dataclasses
import functools
import math
import pathlib
import time
from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np
import scipy

from mazebench.constants import ON_TIME
from mazebench.errors import InputError
from mazebench.maps.doors import Passage
from mazebench.maps.follower import follow
from mazebench.maps.maze import Maze
from mazebench.maps.passages import find_passages
from mazebench.maps.search import search
from mazebench.storage import cache

LATE = (
    0.15,
    0.3,
    0.4,
)  # share of late episodes at strengths 1, 2, 3; with moved doors .16, .30 and .39 (`benchmarks.measures`)
LATE_WITHOUT_MAP = 0.2  # the least in a changed building; with less, no map is worth much there
LATE_IN_PLAN = 0.1  # the least in the plan; with less, only what has changed could make a robot late
WORTH = 0.05  # at strength 1, the least by which lateness without a map is above lateness with the plan
SIGHT = 3.5  # m, how far the robot sees
NEAREST, FARTHEST = 15.0, 40.0  # m from start to goal, as on the tracks
FURNITURE = 0.5, 2.0  # m, the sides of pieces of furniture
CLEAR = 0.6  # m, that stay free around furniture
_NUM_PAIRS = 600  # on which lateness is measured, with a standard error of at most .02
_MISS = 0.03  # by which lateness on these pairs may miss that of a strength
_NUM_TRIES, _NUM_MISSES = 8, 7  # of a strength, and of changes in a row that a try does not keep
_CELL = 1e-6  # cells, a tolerance
_KEPT_FROM = 2.0  # s of CPU to make a change, which is then kept on disk
_CODE = ("changes.py", "passages.py", "follower.py", "search.py", "sight.py", "../constants.py")  # that makes changes


class _Drives(NamedTuple):
    """The episodes in a building on which lateness is measured."""

    walls: np.ndarray  # [N, N] bool, of the building
    is_late: np.ndarray  # [P] bool
    boxes: np.ndarray  # [P, 4] int, as of `follow`


class Change(NamedTuple):
    """The changes in a building since its plan was drawn, or a draft of them, and their cost."""

    walls: np.ndarray  # [N, N] bool
    done: tuple[str, ...] = ()  # a passage was "closed" or "opened", a piece of furniture "added" or "removed"
    late: float = 0.0  # share of late episodes of a robot that believes the plan
    late_without_map: float = 0.0  # of one that takes for free what it has not seen
    blocked: float = 0.0  # share of those in which the shortest way on the plan is blocked
    # Of drafts only.
    is_left: np.ndarray = np.zeros(0, dtype=bool)  # [Q]: the passages of the plan that may still change
    things: tuple[tuple[tuple[slice, ...], np.ndarray], ...] = ()  # furniture of the plan: its box and shape
    drives: _Drives | None = None  # on which `late` was measured

    def __str__(self) -> str:
        closed, opened, added, removed = map(self.done.count, ("closed", "opened", "added", "removed"))
        return (
            f"{closed} passages closed, {opened} opened, {added} pieces of furniture added, {removed} removed; "
            f"late {self.late:.2f} with the old map and {self.late_without_map:.2f} without, "
            f"shortest way blocked {self.blocked:.2f}"
        )


def changed(maze: Maze, strength: int, rng: np.random.Generator) -> Maze:
    """Returns a building in which things have changed since `maze` was drawn, its old map.

        >>> plan = mazebench.generate("house", 31, np.random.default_rng(0))
        >>> building = mazebench.changed(plan, 1, np.random.default_rng(0))
        >>> building.name, building.size, building == plan
        ('house-31-changed', 31, False)

    Passages of up to 2.4 m are closed, doors are opened in walls, and furniture comes and goes. The building has the
    cells of the old map, their size and its kind. The changes of a larger strength begin with those of a smaller one.
    A building that took over 2 s of CPU is kept in the user's cache, unless MAZEBENCH_NO_CACHE is set.

    Args:
      maze: the old map.
      strength: 1, 2 or 3. A robot that drives by the old map takes over 1.25 times the shortest way in .15, .3 and .4
        of episodes.
      rng: the random stream, of which one number is drawn.

    Raises:
      InputError: if the building can't carry the strength, with the share of late episodes that was found.
    """
    return change(maze, strength, rng, f"{maze.name}-changed")[0]


def changed_buildings(maze: Maze, strength: int, count: int, seed: int) -> tuple[Maze, ...]:
    """Returns `count` changed buildings of one old map, named after it with `-changed-1` and so on; see `changed`.

    The first ones do not depend on `count`.

    Raises:
      InputError: if a building can't carry the strength.
    """
    return tuple(building for building, _ in changes(maze, strength, count, seed))


def changes(maze: Maze, strength: int, count: int, seed: int) -> Iterator[tuple[Maze, Change]]:
    """Yields the changed buildings that `changed_buildings` returns, with what has changed in them."""
    for index in range(count):
        yield change(maze, strength, np.random.default_rng([seed, index]), f"{maze.name}-changed-{index + 1}")


def change(maze: Maze, strength: int, rng: np.random.Generator, name: str) -> tuple[Maze, Change]:
    """Returns what `changed` does, with that name and with what has changed."""
    if not isinstance(maze, Maze):
        raise InputError(f"expected a Maze, found {type(maze).__name__}")
    if isinstance(strength, bool | float) or strength not in (1, 2, 3):
        raise InputError(f"expected a strength of 1 to 3, found {strength!r}")
    if not isinstance(rng, np.random.Generator):
        raise InputError(f"expected rng as a numpy.random.Generator, found {type(rng).__name__}")
    seed = int(rng.integers(2**63))
    code = (pathlib.Path(__file__).parent / each for each in _CODE)
    asked = np.packbits(maze.walls).tobytes(), maze.cell_size, int(strength), seed
    file = cache.file_for("changed-buildings", code, *asked)
    if kept := cache.load(file):
        walls = np.unpackbits(kept["walls"], count=maze.walls.size).reshape(maze.walls.shape).astype(bool)
        found = Change(walls, tuple(kept["done"].tolist()), *kept["shares"].tolist())
    else:
        began = time.process_time()
        found = _make(_Plan(maze, seed), strength)
        if time.process_time() - began >= _KEPT_FROM:
            shares = np.array([found.late, found.late_without_map, found.blocked])
            cache.keep(file, walls=np.packbits(found.walls), done=np.array(found.done, dtype=str), shares=shares)
    return dataclasses.replace(maze, walls=found.walls, name=name), found


def _make(plan: _Plan, strength: int) -> Change:
    """Returns the change of a plan; raises `InputError` if it can't carry the strength."""
    late = plan.late_without_map(plan.walls)
    if late < LATE_IN_PLAN:
        raise InputError(
            f"{plan.name}: expected a building in which a robot without a map is late in at least {LATE_WITHOUT_MAP} "
            f"of the episodes, and before it has changed in at least {LATE_IN_PLAN}, and not one so open "
            f"that an old map costs nothing; found {late:.2f}"
        )
    found = plan.unchanged()
    for each in range(1, strength + 1):
        found = _changed_more(plan, found, each)
    blocked = float(plan.is_blocked(found.walls).mean())
    return Change(found.walls, found.done, found.late, found.late_without_map, blocked)


class _Strips:
    """The passages of a plan in arrays, which are looked through at each change."""

    def __init__(self, passages: tuple[Passage, ...], size: int):
        self.boxes = np.array(passages, dtype=np.int64).reshape(-1, 5)  # [Q, 5], as `Passage` has them
        self.is_open = self.boxes[:, 4] > 0  # [Q] bool
        self._inside, self._around = _cells_of(self.boxes, size, 0), _cells_of(self.boxes, size, 1)
        self._has_edge = (self.boxes[:, :2] > 0).all(axis=1)  # else nothing touches it

    def most(self, values: np.ndarray) -> np.ndarray:
        """Returns the largest one of some values of cells (`[N * N]`) in each passage: `[Q]`."""
        cells, starts = self._inside
        return np.maximum.reduceat(values[cells], starts) if len(starts) else np.zeros(0, dtype=values.dtype)

    def touch(self, cells: np.ndarray) -> np.ndarray:
        """Returns the passages that have some of the cells (`[N, N]` bool) in them or at their edge: `[Q]` bool."""
        around, starts = self._around
        touched = np.logical_or.reduceat(cells.ravel()[around], starts) if len(starts) else self._has_edge
        return np.asarray(self._has_edge & touched)


def _cells_of(boxes: np.ndarray, size: int, margin: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns the numbers of the cells of passages with a margin, one after the other, and where each begins."""
    top, left, bottom, right = (boxes[:, :4] + [-margin, -margin, margin, margin]).clip(0, size).T
    widths = right - left
    counts = (bottom - top) * widths
    starts = np.append(0, np.cumsum(counts))
    place = np.arange(starts[-1]) - np.repeat(starts[:-1], counts)
    down, aside = np.divmod(place, np.repeat(widths, counts))
    return (np.repeat(top, counts) + down) * size + np.repeat(left, counts) + aside, starts[:-1]


class _Plan:
    """The old map, and the pairs of a start and a goal on which lateness is measured."""

    def __init__(self, maze: Maze, seed: int):
        self.walls, self.cell_size, self.name, self.seed = maze.walls, maze.cell_size, maze.name, seed
        self.sight = max(1.0, SIGHT / maze.cell_size)  # cells
        self.pairs = draw_pairs(maze, _NUM_PAIRS, np.random.default_rng([seed, 0, 0]))  # [P, 2] int

        # The ways on the plan by which changes are drawn; of other pairs, else these would be more late than any.
        pairs = draw_pairs(maze, _NUM_PAIRS, np.random.default_rng([seed, 0, 1]))
        cells, lengths, *_ = follow(maze.walls, maze.walls, pairs, 1.0, 1.0)
        ends = np.cumsum(lengths + 1)
        ways = np.ones(len(cells), dtype=np.int64), cells, np.append(0, ends)
        self.ways = scipy.sparse.csr_array(ways, shape=(len(pairs), maze.walls.size))  # 1 at the cells of each way

    def unchanged(self) -> Change:
        """Returns a draft in which nothing has changed."""
        # Furniture: walls that touch no others, not even at a corner.
        areas, _ = scipy.ndimage.label(self.walls, np.ones((3, 3)))
        boxes = enumerate(scipy.ndimage.find_objects(areas), start=1)
        most = FURNITURE[1] / self.cell_size + _CELL
        things = [(box, areas[box] == area) for area, box in boxes if max(areas[box].shape) <= most]
        return Change(self.walls, is_left=np.ones(len(self.strips.boxes), dtype=bool), things=tuple(things))

    @functools.cached_property
    def strips(self) -> _Strips:
        """The passages."""
        return _Strips(find_passages(self.walls, self.cell_size), len(self.walls))

    def drives(self, walls: np.ndarray, shown: np.ndarray, before: _Drives | None = None) -> tuple[float, _Drives]:
        """Returns the share of late episodes in a building of a robot that is shown a map of it, and the episodes.

        Those of a building `before` are taken where nothing has changed that they depend on.
        """
        boxes, is_late = np.tile([0, len(walls), 0, len(walls)], (len(self.pairs), 1)), np.zeros(len(self.pairs), bool)
        is_free = is_new = ~walls.ravel()[self.pairs].any(axis=1)
        if before is not None:
            boxes, is_late = before.boxes.copy(), before.is_late.copy()
            rows, columns = np.nonzero(walls != before.walls)
            top, bottom, left, right = boxes.T[..., None]
            touched = (top <= rows) & (rows <= bottom) & (left <= columns) & (columns <= right)
            is_new = is_free & touched.any(axis=1)
        _, driven, shortest, boxes[is_new] = follow(walls, shown, self.pairs[is_new], self.sight, ON_TIME[0])
        is_late[is_new] = driven > ON_TIME[0] * shortest
        return float(is_late[is_free].mean()) if is_free.any() else 0.0, _Drives(walls, is_late, boxes)

    def late_without_map(self, walls: np.ndarray) -> float:
        """Returns the share of late episodes of a robot that takes for free what it has not seen."""
        return self.drives(walls, np.zeros_like(walls))[0]

    def is_blocked(self, walls: np.ndarray) -> np.ndarray:
        """Returns the ways on the plan that are blocked in a building: `[P]` bool."""
        return self.ways @ walls.ravel() > 0


def _changed_more(plan: _Plan, draft: Change, strength: int) -> Change:
    """Returns a draft of the next smaller strength, changed until it has this one."""
    target = LATE[strength - 1]
    tries: list[tuple[bool, float, int, Change]] = []
    for number in range(_NUM_TRIES):
        # A change is kept if as many episodes are late as before, or more, but not too many.
        rng, now, num_misses = np.random.default_rng([plan.seed, strength, number]), draft, 0
        while now.late < target and num_misses < _NUM_MISSES and (new := _step(plan, now, rng)) is not None:
            if new.walls is not now.walls:
                late, drives = plan.drives(new.walls, plan.walls, now.drives)
                new = new._replace(late=late, drives=drives)
            is_kept = now.late <= new.late <= target + _MISS
            now, num_misses = (new, 0) if is_kept else (now, num_misses + 1)

        # The first try that is late enough counts, or the latest of all.
        can_carry = now.late >= target - _MISS
        if can_carry:
            now = now._replace(late_without_map=plan.late_without_map(now.walls))
            can_carry = now.late_without_map >= max(LATE_WITHOUT_MAP, now.late + WORTH if strength == 1 else 0.0)
        tries.append((can_carry, now.late, -number, now))
        if can_carry and now.late >= target:
            break
    can_carry, late, _, best = max(tries)
    if not can_carry:
        raise InputError(
            f"{plan.name}: expected changes of strength {strength}, by which a robot is late in {target} of the "
            f"episodes with the old map, and without a map in at least {LATE_WITHOUT_MAP} and at strength 1 in {WORTH} "
            f"more than with it, and not one so open that an old map costs less; found {late:.2f} with it and "
            f"{plan.late_without_map(best.walls):.2f} without"
        )
    return best


def _step(plan: _Plan, draft: Change, rng: np.random.Generator) -> Change | None:
    """Returns a draft in which one passage more has changed, or only can't change any more; None if none can change.

    With a passage, a piece of furniture comes or goes in half of the steps.
    """
    # The passages to close, by how many ways pass that nothing blocks yet; those to open, one like the other.
    strips = plan.strips
    weights = np.where(draft.is_left & strips.is_open, strips.most(~plan.is_blocked(draft.walls) @ plan.ways), 0)
    is_walled = draft.is_left & ~strips.is_open
    if not weights.any() or (rng.integers(4) == 0 and is_walled.any()):
        weights = is_walled.astype(np.int64)
    if not weights.any():
        return None

    # One of them. If that parts the building, a door is opened between the two parts.
    index = int(np.cumsum(weights).searchsorted(rng.integers(weights.sum()), side="right"))
    new = _turned(plan, draft, index)
    areas, num_areas = scipy.ndimage.label(~new.walls)
    if num_areas == 2 and strips.is_open[index]:
        doors = np.flatnonzero(new.is_left & ~strips.is_open & strips.touch(areas == 1) & strips.touch(areas == 2))
        if len(doors):
            new, num_areas = _turned(plan, new, doors[rng.integers(len(doors))]), 1
    if num_areas != 1:
        return draft._replace(is_left=draft.is_left & (strips.boxes != strips.boxes[index]).any(axis=1))
    return _furnished(plan, new, rng) if rng.integers(2) else new


def _turned(plan: _Plan, draft: Change, index: int) -> Change:
    """Returns a draft in which a passage is closed that is open on the plan, or opened; those that touch it stay."""
    passage = Passage(*plan.strips.boxes[index].tolist())
    walls = draft.walls.copy()
    walls[passage.cells()] = passage.is_open
    is_left = draft.is_left & ~plan.strips.touch(walls != draft.walls)
    return draft._replace(walls=walls, is_left=is_left, done=(*draft.done, "closed" if passage.is_open else "opened"))


def _furnished(plan: _Plan, draft: Change, rng: np.random.Generator) -> Change:
    """Returns a draft in which a piece of furniture has gone or come; neither can part the building."""
    walls = draft.walls.copy()
    if draft.things and rng.integers(2):
        index = rng.integers(len(draft.things))
        box, shape = draft.things[index]
        walls[box] &= ~shape
        things = draft.things[:index] + draft.things[index + 1 :]
        return draft._replace(walls=walls, things=things, done=(*draft.done, "removed"))

    # Of a size in whole cells, where it and its surroundings are free.
    least = math.ceil(FURNITURE[0] / plan.cell_size - _CELL)
    most = max(least, math.floor(FURNITURE[1] / plan.cell_size + _CELL))
    height, width = rng.integers(least, most + 1, 2)
    clear = math.ceil(CLEAR / plan.cell_size - _CELL)
    space = np.ones((height + 2 * clear, width + 2 * clear), np.uint8)
    free = (~(walls | plan.walls)).astype(np.uint8)
    places = np.argwhere(cv2.erode(free, space, anchor=(0, 0), borderType=cv2.BORDER_CONSTANT, borderValue=0))
    if not len(places):
        return draft
    row, column = rng.choice(places) + clear
    walls[row : row + height, column : column + width] = True
    return draft._replace(walls=walls, done=(*draft.done, "added"))


def draw_pairs(maze: Maze, count: int, rng: np.random.Generator) -> np.ndarray:
    """Returns pairs of a start and a goal, as numbers of cells: `[P, 2]` int.

    They are 15 to 40 m apart, or the longer half of what the maze has.
    """
    free = np.flatnonzero(~maze.walls)
    farthest, _ = search(maze.walls, free[0], -1, maze.walls.size)
    _, ends = search(maze.walls, farthest[-1], -1, maze.walls.size)
    most = min(FARTHEST / maze.cell_size + _CELL, len(ends) - 1)
    least = math.ceil(min(NEAREST / maze.cell_size - _CELL, most / 2))
    pairs: list[tuple[int, int]] = []
    while len(pairs) < count:
        distance, start = int(rng.integers(least, int(most) + 1)), rng.choice(free)
        cells, ends = search(maze.walls, start, -1, distance)
        if len(ends) > distance:
            pairs.append((start, rng.choice(cells[ends[distance - 1] if distance else 0 :])))
    return np.array(pairs)
