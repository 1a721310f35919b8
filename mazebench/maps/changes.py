"""Buildings in which things have changed since their map was drawn.

The maze that is given is the old map, here called the plan. In a changed building, open passages are closed, walled
ones are opened, and furniture has come and gone. The strength of the changes is their cost to a robot on the grid that
believes the plan: an episode is late if the robot drives over 1.25 times the shortest way. All that is drawn and
compared are whole numbers and their ratios, so that one seed gives one building on every machine.

`P` is the number of pairs of a start and a goal, and `N` of rows and columns.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view

from mazebench.constants import ON_TIME
from mazebench.errors import InputError
from mazebench.maps.follower import follow
from mazebench.maps.maze import Maze
from mazebench.maps.passages import Passage, find_passages
from mazebench.maps.search import search

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


class Change(NamedTuple):
    """The changes in a building since its plan was drawn, or a draft of them, and their cost."""

    walls: np.ndarray  # [N, N] bool
    passages: tuple[Passage, ...]  # that may still change
    things: tuple[tuple[tuple[slice, ...], np.ndarray], ...]  # furniture of the plan that is left: its box and shape
    done: tuple[str, ...] = ()  # a passage was "closed" or "opened", a piece of furniture "added" or "removed"
    late: float = 0.0  # share of late episodes of a robot that believes the plan
    late_without_map: float = 0.0  # of one that takes for free what it has not seen
    blocked: float = 0.0  # share of those in which the shortest way on the plan is blocked

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
    plan = _Plan(maze, seed=int(rng.integers(2**63)))
    late = plan.late_without_map(maze.walls)
    if late < LATE_IN_PLAN:
        raise InputError(
            f"{maze.name}: expected a building in which a robot without a map is late in at least {LATE_WITHOUT_MAP} "
            f"of the episodes, and before it has changed in at least {LATE_IN_PLAN}; found {late:.2f}"
        )
    found = plan.unchanged()
    for each in range(1, strength + 1):
        found = _changed_more(plan, found, each)
    found = found._replace(blocked=float(plan.is_blocked(found.walls).mean()))
    return dataclasses.replace(maze, walls=found.walls, name=name), found


class _Plan:
    """The old map, and the pairs of a start and a goal on which lateness is measured."""

    def __init__(self, maze: Maze, seed: int):
        self.walls, self.cell_size, self.name, self.seed = maze.walls, maze.cell_size, maze.name, seed
        self.sight = max(1.0, SIGHT / maze.cell_size)  # cells
        self.pairs = draw_pairs(maze, _NUM_PAIRS, np.random.default_rng([seed, 0, 0]))  # [P, 2] int

        # The ways on the plan by which changes are drawn; of other pairs, else these would be more late than any.
        pairs = draw_pairs(maze, _NUM_PAIRS, np.random.default_rng([seed, 0, 1]))
        cells, lengths, _ = follow(maze.walls, maze.walls, pairs, 1.0, 1.0)
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
        return Change(self.walls, find_passages(self.walls, self.cell_size), tuple(things))

    def late(self, walls: np.ndarray, shown: np.ndarray) -> float:
        """Returns the share of late episodes in a building of a robot that is shown a map of it."""
        pairs = self.pairs[~walls.ravel()[self.pairs].any(axis=1)]
        _, driven, shortest = follow(walls, shown, pairs, self.sight, ON_TIME[0])
        return float((driven > ON_TIME[0] * shortest).mean()) if len(pairs) else 0.0

    def late_without_map(self, walls: np.ndarray) -> float:
        """Returns the same of a robot that takes for free what it has not seen."""
        return self.late(walls, np.zeros_like(walls))

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
                new = new._replace(late=plan.late(new.walls, plan.walls))
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
            f"more than with it; found {late:.2f} with it and {plan.late_without_map(best.walls):.2f} without"
        )
    return best


def _step(plan: _Plan, draft: Change, rng: np.random.Generator) -> Change | None:
    """Returns a draft in which one passage more has changed, or only can't change any more; None if none can change.

    With a passage, a piece of furniture comes or goes in half of the steps.
    """
    # The passages to close, by how many ways pass that nothing blocks yet; those to open, one like the other.
    num_ways = (~plan.is_blocked(draft.walls) @ plan.ways).reshape(draft.walls.shape)
    weights = [int(num_ways[each.cells()].max()) if each.is_open else 0 for each in draft.passages]
    is_walled = [int(not each.is_open) for each in draft.passages]
    if not any(weights) or (rng.integers(4) == 0 and any(is_walled)):
        weights = is_walled
    if not any(weights):
        return None

    # One of them. If that parts the building, a door is opened between the two parts.
    passage = draft.passages[np.cumsum(weights).searchsorted(rng.integers(sum(weights)), side="right")]
    new = _turned(draft, passage)
    areas, num_areas = scipy.ndimage.label(~new.walls)
    if num_areas == 2 and passage.is_open:
        doors = [each for each in new.passages if not each.is_open and {1, 2} <= set(areas[each.cells(margin=1)].flat)]
        if doors:
            new, num_areas = _turned(new, doors[rng.integers(len(doors))]), 1
    if num_areas != 1:
        return draft._replace(passages=tuple(each for each in draft.passages if each != passage))
    return _furnished(plan, new, rng) if rng.integers(2) else new


def _turned(draft: Change, passage: Passage) -> Change:
    """Returns a draft in which a passage is closed that is open on the plan, or opened; those that touch it stay."""
    walls = draft.walls.copy()
    walls[passage.cells()] = passage.is_open
    has_changed = walls != draft.walls
    passages = tuple(each for each in draft.passages if not has_changed[each.cells(margin=1)].any())
    return draft._replace(walls=walls, passages=passages, done=(*draft.done, "closed" if passage.is_open else "opened"))


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
    taken = np.pad(walls | plan.walls, (0, most + 2 * clear), constant_values=True)
    spaces = sliding_window_view(taken, (height + 2 * clear, width + 2 * clear))
    places = np.argwhere(~spaces.any(axis=(2, 3)))
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
