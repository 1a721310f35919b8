"""A belief over the doors of a shown map: which may have moved, and buildings drawn given what was seen.

Doors change as this benchmark changes them (`mazebench.maps.doors`): a door that was opened lies on a way around one
that was closed, so they are drawn in pairs. In cells that are not 1 m wide, each passage changes on its own. How many
have changed is one of four rates: none, or those by which 45, 70 or 85 % of the shortest paths on a map are blocked.

`N` is the number of cells on a side, `D` of doors, `S` of buildings.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mazebench.kernels import compiled, inlined
from mazebench.maps.doors import DoorGraph
from mazebench.maps.kinds.kind import door_slots, lattice_door_slots
from mazebench.maps.maze import Cell
from mazebench.maps.passages import find_passages

from .ways import FAR, UNKNOWN, WALL, cheapest_path, steps_to

_BLOCKED = np.array([0.0, 0.45, 0.70, 0.85])  # of the shortest paths on the map, by level; each is as likely
_PATH = 27.0  # m, the mean length of these paths
_ON_LATTICE = 0.72  # share of slots between cells of the odd lattice, from which all are; in houses it is a half
_LEAST_RATE = 1e-4
_PRIOR = 4  # drawn buildings that a door's rate weighs as much as
_SURE = (0.002, 0.995)  # the least and the largest probability that a door is closed
_TRIES = 6  # draws for each building that is wanted, of which some have no way to the goal


class DoorBelief:
    """The doors of a shown map, and what is known of them."""

    def __init__(self, shown: np.ndarray, cell_size: float, path_from: Cell, goal: Cell):
        """Finds the doors of a map `[N, N]` bool, and how often they change by the path from a cell to the goal."""
        self.shown = shown
        self.number = np.full(shown.shape, -1)  # [N, N] int: of the door that a cell belongs to
        if cell_size == 1.0:
            slots = door_slots(shown)
            if len(slots) and (slots.sum(axis=1) % 2 == 1).mean() > _ON_LATTICE:
                slots = lattice_door_slots(shown)
            self.number[tuple(slots.T)] = np.arange(len(slots))
            self.is_open = ~shown[tuple(slots.T)]
            self.pairs = _pairs_of(shown, slots, self.is_open)
        else:
            passages = find_passages(shown, cell_size)
            for number, passage in enumerate(passages):
                self.number[passage.cells()] = number
            self.is_open = np.array([passage.is_open for passage in passages], dtype=bool)
            self.pairs = _no_pairs(len(passages))

        # Each level's rate blocks its share of the paths, which lead through so many doors.
        known = np.full(shown.shape, UNKNOWN, np.int8)
        path = cheapest_path(known, shown, self.number, np.where(self.is_open, 0.0, 1e3), path_from, goal)
        num_doors = (self.number.ravel()[path] >= 0).sum() * _PATH / (max(len(path), 1) * cell_size)
        self._rates = 1 - (1 - _BLOCKED) ** (1 / max(2.0, num_doors))  # [4], of the open doors
        num_open = self.is_open.sum()
        self._opened = np.clip(self._rates * num_open / max(1, (~self.is_open).sum()), _LEAST_RATE, 0.9)
        self._closed = np.clip(self._rates, _LEAST_RATE, 0.9)

    def levels(self, changed: np.ndarray) -> np.ndarray:
        """Returns `[4]`: the probability of each level, by doors `changed` `[D]` int8: 1, or 0; -1 if unknown."""
        log_odds = np.zeros(len(_BLOCKED))
        for of, rates in ((self.is_open, self._closed), (~self.is_open, self._opened)):
            num_changed, num_same = (changed[of] == 1).sum(), (changed[of] == 0).sum()
            log_odds += num_changed * np.log(rates) + num_same * np.log(1 - rates)
        weights = np.exp(log_odds - log_odds.max())
        return weights / weights.sum()

    def draw(self, known: np.ndarray, cell: Cell, start: Cell, goal: Cell, count: int, seed: int) -> Drawn:
        """Draws buildings given what is known.

        Args:
          known: `[N, N]` int8: `WALL`, `FREE` or `UNKNOWN`.
          cell: where the robot is; `start` is where its way began. From both, a way leads to the `goal`.
          count: how many buildings; there may be fewer.
          seed: of the draws.
        """
        changed = _changed(known, self.shown, self.number, len(self.is_open))
        levels = self.levels(changed)
        rates = np.array([levels @ self._closed, levels @ self._opened])
        walls, lengths = _draw_buildings(
            count, self.shown, known, self.number, self.is_open, changed, self.pairs, levels, self._rates, self._opened,
            1 / rates[1], np.array([row * len(self.shown) + column for row, column in (cell, start, goal)]),
            np.random.default_rng(seed),
        )  # fmt: skip
        prior = np.where(self.is_open, rates[0], 1 - rates[1])
        share = _closed_shares(walls, self.number, len(self.is_open))
        closed = (share * len(walls) + prior * _PRIOR) / (len(walls) + _PRIOR)
        return Drawn(walls, lengths, np.clip(closed, *_SURE))


class Drawn(NamedTuple):
    """Buildings that were drawn, and what they have in common."""

    walls: np.ndarray  # [S, N, N] bool
    lengths: np.ndarray  # [S] float, the steps from the start of the way to the goal
    closed: np.ndarray  # [D] float, the probability that a door is closed


class Pairs(NamedTuple):
    """Which doors change together: with a closed door that opens, an open one on a shortest way around it closes."""

    first: np.ndarray  # [D + 1] int: those of door d are around[first[d]:first[d + 1]]
    around: np.ndarray  # int, the open doors on a way around each closed one
    opens: np.ndarray  # [D] float, the weight with which a closed door opens, in sum 1; 0 for open ones
    closes: np.ndarray  # [D] float, the weight with which an open door on a way around closes


def _no_pairs(count: int) -> Pairs:
    return Pairs(np.zeros(count + 1, np.int64), np.zeros(0, np.int64), np.zeros(count), np.zeros(count))


def _pairs_of(shown: np.ndarray, slots: np.ndarray, is_open: np.ndarray) -> Pairs:
    """Returns the pairs of the doors at `slots` `[D, 2]`, weighed as `mazebench.maps.doors.swap_doors` draws them."""
    doors = DoorGraph(shown, slots)
    odds = doors.odds[doors.types()]
    around = [[] if each else doors.way_around(door) for door, each in enumerate(is_open.tolist())]
    counts = np.array([len(each) for each in around], dtype=np.int64)
    opens = np.where(counts > 0, odds, 0.0)
    return Pairs(
        np.concatenate([[0], np.cumsum(counts)]),
        np.array([door for each in around for door in each], dtype=np.int64),
        opens / max(opens.sum(), 1e-9),
        1 / odds,
    )


@compiled
def _changed(known: np.ndarray, shown: np.ndarray, number: np.ndarray, count: int) -> np.ndarray:
    """Returns `[D]` int8: 1 for doors of which a cell is known to have changed, 0 for other known ones, -1 else."""
    changed = np.full(count, -1, np.int8)
    for row in range(len(known)):
        for column in range(len(known)):
            door = number[row, column]
            if door >= 0 and known[row, column] != UNKNOWN:
                changed[door] = max(changed[door], (known[row, column] == WALL) != shown[row, column])
    return changed


@compiled
def _closed_shares(walls: np.ndarray, number: np.ndarray, count: int) -> np.ndarray:
    """Returns `[D]` float: the share of buildings `[S, N, N]` in which each door is closed."""
    shares = np.zeros(count)
    for building in walls:
        closed = np.zeros(count)
        for row in range(len(number)):
            for column in range(len(number)):
                if number[row, column] >= 0 and building[row, column]:
                    closed[number[row, column]] = 1.0
        shares += closed / len(walls)
    return shares


@compiled
def _draw_buildings(
    count: int, shown: np.ndarray, known: np.ndarray, number: np.ndarray, is_open: np.ndarray, changed: np.ndarray,
    pairs: Pairs, levels: np.ndarray, closing: np.ndarray, opening: np.ndarray, known_to_open: float,
    cells: np.ndarray, rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Returns the walls and lengths of `Drawn`, by the doors that are known to have `changed` (`[D]`, as `_changed`).

    Args:
      levels: `[4]`, the probability of each level, at which `closing` open doors and `opening` closed ones change.
      known_to_open: how much likelier a door that is known to be open belongs to one that was closed.
      cells: the flat indices of the robot's cell, the start, and the goal.
      The rest is that of `DoorBelief.draw`.
    """
    size, num_doors = len(shown), len(is_open)
    walls, lengths = np.empty((count, size, size), np.bool_), np.empty(count)
    num_drawn = 0
    for _ in range(_TRIES * count):
        if num_drawn == count:
            break
        level = _index(levels, rng)
        moved = changed == 1  # the doors that have changed in this building
        if pairs.opens.sum() > 0:
            left = round(closing[level] * is_open.sum())
            # To each door that is known to have closed belongs one that opened, known or not.
            paired = np.zeros(num_doors, np.bool_)
            for closed in range(num_doors):
                if is_open[closed] and changed[closed] == 1:
                    opened = _opened_with(closed, changed, paired, pairs, known_to_open, rng)
                    if opened >= 0:
                        paired[opened] = moved[opened] = True
                    left -= 1
            # And the other way round.
            for opened in range(num_doors):
                if not is_open[opened] and changed[opened] == 1 and not paired[opened]:
                    closed = _closed_with(opened, changed, moved, pairs, False, rng)
                    if closed >= 0:
                        moved[closed] = True
                    left -= 1
            # More pairs, of which those count that are unknown.
            for _ in range(max(0, left)):
                opened = _index(pairs.opens, rng)
                closed = -1 if moved[opened] else _closed_with(opened, changed, moved, pairs, True, rng)
                if closed >= 0 and changed[opened] < 0 and changed[closed] < 0:
                    moved[opened] = moved[closed] = True
        else:
            for door in range(num_doors):
                rate = closing[level] if is_open[door] else opening[level]
                moved[door] |= changed[door] < 0 and rng.random() < rate

        building = walls[num_drawn]
        for row in range(size):
            for column in range(size):
                door = number[row, column]
                if known[row, column] != UNKNOWN:
                    building[row, column] = known[row, column] == WALL
                else:
                    building[row, column] = shown[row, column] != (door >= 0 and moved[door])
        for cell in cells:
            building[cell // size, cell % size] = False
        steps = steps_to(building, cells[2])
        if steps[cells[0]] < FAR and steps[cells[1]] < FAR:
            lengths[num_drawn] = max(1.0, steps[cells[1]])
            num_drawn += 1
    return walls[:num_drawn], lengths[:num_drawn]


@inlined
def _index(weights: np.ndarray, rng: np.random.Generator) -> int:
    """Returns an index, each in proportion to its weight, of which some are not 0."""
    left = rng.random() * weights.sum()
    for index in range(len(weights)):
        left -= weights[index]
        if left < 0:
            return index
    return int(np.argmax(weights))


@inlined
def _opened_with(
    closed: int, changed: np.ndarray, paired: np.ndarray, pairs: Pairs, known_to_open: float, rng: np.random.Generator
) -> int:
    """Returns a door that opened where another is known to have closed, and belongs to no other; -1 without any."""
    weights = np.zeros(len(paired))
    for opened in range(len(paired)):
        if pairs.opens[opened] > 0 and changed[opened] != 0 and not paired[opened]:
            total, own = 0.0, 0.0
            for door in pairs.around[pairs.first[opened] : pairs.first[opened + 1]]:
                total += pairs.closes[door]
                own += pairs.closes[door] * (door == closed)
            weights[opened] = pairs.opens[opened] * own / total * (known_to_open if changed[opened] == 1 else 1.0)
    return _index(weights, rng) if weights.sum() > 0 else -1


@inlined
def _closed_with(
    opened: int, changed: np.ndarray, moved: np.ndarray, pairs: Pairs, known_too: bool, rng: np.random.Generator
) -> int:
    """Returns a door that closed where another opened, an unknown one unless `known_too`; -1 without any."""
    around = pairs.around[pairs.first[opened] : pairs.first[opened + 1]]
    weights = np.zeros(len(around))
    for index, door in enumerate(around):
        if not moved[door] and (known_too or changed[door] < 0):
            weights[index] = pairs.closes[door]
    return around[_index(weights, rng)] if weights.sum() > 0 else -1
