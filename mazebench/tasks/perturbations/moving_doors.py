"""Doors that close, and perhaps open again, while one drives: how the schedule of an episode is drawn."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from mazebench.errors import InputError
from mazebench.maps.doors import Passage
from mazebench.maps.maze import Cell, Maze
from mazebench.maps.moving_doors import is_joined, moved_walls, moving_doors
from mazebench.tasks.perturbations.perturbation import Of, Perturbation
from mazebench.tasks.schedule import DoorTimes
from mazebench.tasks.streams import Stream

STEPS_PER_METRE = 1.7  # of a way from cell to cell; the oracle's drives take 1.68 on the frozen mazes
_FIRST = 4  # the earliest step after which a door closes
_LEAST_AHEAD = 5.0  # m from the start to the door that closes on the way
_LEAST_DETOUR = 6.0  # m by which the way around it is longer, if the building has such a door
# Steps that doors which open again stay closed, and rest open; of the one on the way, at least and at most so many.
_STAYS, _RESTS = (20, 81), (60, 161)
_SHORTEST, _LONGEST_WAIT = 12, 120
_EARLY, _NEAR = (5.0, 12.0), (3.0, 5.5)  # steps before a body comes, after which a door closes for ever, and for a time
_FASTEST = 0.85  # of the usual steps, in which a body comes at the earliest
_WAITS = (0.0, 1.5)  # of the steps that the way around costs, in which a door opens after a body has come
_OTHERS = 2  # doors that move besides that on the way, at levels 1 and 2
_TICK = 16  # steps, of whose multiples level 3 makes its times


class OnWay(NamedTuple):
    """A door on a shortest way that can close."""

    number: int  # among `moving_doors`
    other: int | None  # the door that opens when it closes; None where there is a way around it
    ahead: int  # cells from the start
    detour: int  # cells by which the way around it is longer


@dataclasses.dataclass(frozen=True)
class MovingDoors(Perturbation):
    """Doors that move: one on a shortest way, and others. The shown map is right when the episode begins.

    Where the door on the way would part the building, another door is open as long as that one is closed. A door that
    starts or goals are in does not move.
    """

    opens: bool  # again, or stays closed
    all_doors: bool = False  # all that are open in the building move

    of = Of.DOORS
    stream = Stream.DOORS

    def require(self, maze: Maze) -> None:
        if not any(door.is_open for door in moving_doors(maze)):
            raise InputError(f"{maze.name}: expected a door or a passage that can close, found none")

    def times(self, maze: Maze, ends: Sequence[Cell], rng: np.random.Generator) -> dict[int, DoorTimes]:
        """Draws the times of the doors that move in an episode, by their numbers among `moving_doors`.

        `ends` are the start and the goals.
        """
        doors = moving_doors(maze)
        movable = [number for number, door in enumerate(doors) if not any(_is_in(cell, door) for cell in ends)]
        if self.all_doors:
            return {number: _of_its_own(rng) for number in movable if doors[number].is_open}

        # One on the way, with the one that opens in its place.
        length, on_way = doors_on_way(maze, ends[0], ends[1])
        steps = STEPS_PER_METRE * maze.cell_size  # per cell
        times: dict[int, DoorTimes] = {}
        if on_way := [each for each in on_way if each.number in movable]:
            chosen = on_way[rng.integers(len(on_way))]
            times[chosen.number] = self._on_way(chosen, steps, rng)
            if chosen.other is not None:
                times[chosen.other] = times[chosen.number]

        # Others, which part the building only if they open again.
        most = len(times) + _OTHERS
        for number in rng.permutation(movable).tolist():
            with_it = [doors[each] for each in (*times, number)]
            if len(times) == most:
                break
            if number in times or not doors[number].is_open:
                continue
            if self.opens or is_joined(moved_walls(maze.walls, with_it)):
                first = int(rng.integers(_FIRST, _FIRST + 1 + math.ceil(steps * length)))
                stays, rests = (int(rng.integers(*each)) for each in (_STAYS, _RESTS))
                times[number] = DoorTimes(first, stays, stays + rests) if self.opens else DoorTimes(first)
        return times

    def _on_way(self, door: OnWay, steps: float, rng: np.random.Generator) -> DoorTimes:
        """Draws the times of the door on the way, which closes when the body comes near.

        Where it opens again, it does so about as often before a body that drives around it would be at the goal as
        after that. `steps` are those of a cell.
        """
        if not self.opens:  # surely before it is there
            return DoorTimes(max(_FIRST, round(_FASTEST * steps * door.ahead - rng.uniform(*_EARLY))))
        arrival = steps * door.ahead
        first = max(_FIRST, round(arrival - rng.uniform(*_NEAR)))
        wait = min(rng.uniform(*_WAITS) * steps * door.detour, _LONGEST_WAIT)
        stays = max(_SHORTEST, round(arrival + wait - first))
        return DoorTimes(first, stays, stays + int(rng.integers(*_RESTS)))


def _of_its_own(rng: np.random.Generator) -> DoorTimes:
    """Draws the times of a door that opens and closes in a period of its own."""
    stays, rests = _TICK * rng.integers(1, 5), _TICK * rng.integers(3, 9)
    return DoorTimes(int(_TICK * rng.integers(1, 1 + rests // _TICK)), int(stays), int(stays + rests))


def doors_on_way(maze: Maze, start: Cell, goal: Cell) -> tuple[int, list[OnWay]]:
    """Returns the cells of a shortest way between two cells of a maze, and the doors on it that can close.

    A door can close if the building stays in one piece, by itself or with another door open.
    """
    doors, to_goal = moving_doors(maze), _distances(maze.walls, goal)
    ahead, cell = {start: 0}, start  # cells from the start, by cell of the way
    while cell != goal:
        row, column = cell
        near = [(row - 1, column), (row, column - 1), (row, column + 1), (row + 1, column)]
        cell = next(each for each in near if to_goal[each] == to_goal[cell] - 1)
        ahead[cell] = len(ahead)
    found = []
    for number, door in enumerate(doors):
        there = min((cells for cell, cells in ahead.items() if _is_in(cell, door)), default=0)
        if not door.is_open or there * maze.cell_size < _LEAST_AHEAD or _is_in(goal, door):
            continue
        for other in (None, *(each for each in range(len(doors)) if not doors[each].is_open)):
            around = moved_walls(maze.walls, [door] if other is None else [door, doors[other]])
            detour = int(_distances(around, goal)[start]) - len(ahead) + 1
            if is_joined(around):
                if detour * maze.cell_size >= _LEAST_DETOUR:
                    found.append(OnWay(number, other, there, detour))
                break
    return len(ahead) - 1, found


def _distances(walls: np.ndarray, goal: Cell) -> np.ndarray:
    """Returns `[N, N]` int: the cells from each free cell to the goal; -1 where there is no way."""
    from mazebench.maps.search import search  # which needs numba

    cells, ends = search(walls, goal[0] * len(walls) + goal[1], -1, walls.size)
    distances = np.full(walls.shape, -1)
    distances.ravel()[cells] = np.repeat(np.arange(len(ends)), np.diff(ends, prepend=0))
    return distances


def _is_in(cell: Cell, door: Passage) -> bool:
    return door.top <= cell[0] < door.bottom and door.left <= cell[1] < door.right
