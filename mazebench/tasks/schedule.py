"""The schedule of a building's doors in an episode: when they move, and which have moved by that.

Times are agent steps: what a step finds moved has moved after the step before. Sets of doors are as `moving_doors` has
them.
"""

from __future__ import annotations

import bisect
import dataclasses
import hashlib
import math
from collections.abc import Sequence

from mazebench.constants import STEP_TIME
from mazebench.maps.doors import Passage
from mazebench.world.bodies import Body

Point = tuple[float, float]

FOREVER = 2**30  # agent steps
_AHEAD = 1024  # steps whose events are listed at once


@dataclasses.dataclass(frozen=True, order=True)
class DoorTimes:
    """The times of one door: it moves after step `first` and each `period` steps later, and back after `away` steps."""

    first: int
    away: int = FOREVER
    period: int = FOREVER

    def is_away(self, step: int) -> bool:
        """Returns whether it is due to have moved after a step."""
        return step >= self.first and (step - self.first) % self.period < self.away


@dataclasses.dataclass(frozen=True, eq=False)
class Schedule:
    """The doors that move in an episode, with their times.

    A door that is due to close stays open as long as the body is nearer than `margin`: it never closes on the body, nor
    within its braking way.
    """

    doors: tuple[Passage, ...]  # all of the building's that can move
    times: dict[int, DoorTimes]  # by the number of the door, of those that move
    margin: float  # m, from the body's centre
    size: int  # N, cells a side of the maze
    cell_size: float  # m
    _parts: dict[int, tuple[list[int], list[int]]] = dataclasses.field(default_factory=dict, init=False, repr=False)

    def due(self, step: int) -> tuple[int, int]:
        """Returns the set of doors that are due to have moved after a step, and a step until which it stays so."""
        if (part := self._parts.get(step // _AHEAD)) is None:
            part = self._parts[step // _AHEAD] = self._events(step // _AHEAD)
        steps, sets = part
        index = bisect.bisect_right(steps, step)
        return sets[index - 1], steps[index]

    def moved_after(self, step: int, moved: int, point: Point) -> int:
        """Returns the set of moved doors after a step that left the body at a point (x, y; m), from the set before."""
        due, _ = self.due(step)
        for number in self.times if due != moved else ():
            door, moves = self.doors[number], (due ^ moved) >> number & 1
            closes = moves and bool(due >> number & 1) == door.is_open
            if closes and self.distance(number, point) < self.margin:
                due ^= 1 << number
        return due

    def box(self, number: int) -> tuple[float, float, float, float]:
        """Returns left, low, right and high side of a door in metres."""
        door, side = self.doors[number], self.cell_size
        return door.left * side, (self.size - door.bottom) * side, door.right * side, (self.size - door.top) * side

    def distance(self, number: int, point: Point) -> float:
        """Returns the metres from a door to a point (x, y); 0 in the door."""
        (left, low, right, high), (x, y) = self.box(number), point
        return math.hypot(max(left - x, x - right, 0.0), max(low - y, y - high, 0.0))

    def _events(self, part: int) -> tuple[list[int], list[int]]:
        """Returns the steps of a part of the time at which something is due, and the sets from then on."""
        begin, events = part * _AHEAD, set()
        for times in self.times.values():
            for offset in (0, times.away):
                event = times.first + offset
                event += max(0, -(-(begin - event) // times.period)) * times.period
                events |= set(range(event, begin + _AHEAD, times.period))
        steps = sorted(events | {begin, begin + _AHEAD})
        sets = [sum(times.is_away(step) << number for number, times in self.times.items()) for step in steps]
        return steps, sets

    def rows(self) -> list[list[int]]:
        """Returns a row for each door that moves: its box, whether it is open at first (1 or 0), and its times."""
        return [
            [*map(int, self.doors[number]), *dataclasses.astuple(times)] for number, times in sorted(self.times.items())
        ]


@dataclasses.dataclass(eq=False)
class DoorKeeper:
    """Tells the maze that stands after each step, by a schedule; mazes are numbered as `ChangingMazes` does."""

    schedule: Schedule
    num_mazes: int
    _settled: tuple[int, int, int] = (0, 0, -1)  # steps from, before, and a maze that then stays: nothing is due

    def after(self, step: int, maze: int, point: Point) -> int:
        """Returns the maze that stands after a step that left the body at a point (x, y; m), from that before."""
        first, end, settled = self._settled
        if maze == settled and first <= step < end:
            return maze
        moved, building = divmod(maze, self.num_mazes)
        moved = self.schedule.moved_after(step, moved, point)
        due, end = self.schedule.due(step)
        stands = building + self.num_mazes * moved
        if moved == due:
            self._settled = step, end, stands
        return stands


def braking_way(body: Body) -> float:
    """Returns the metres from a body's centre within which it may touch something, by a step and by coasting then."""
    return body.reach + body.fastest * (STEP_TIME + body.rest_time(body.fastest))


def moved_along(schedule: Schedule, points: Sequence[Point], step: int = 0, moved: int = 0) -> list[int]:
    """Returns the sets of moved doors at each moment of a drive from its points (x, y; m).

    The first point is that after `step`, when the set `moved` has moved: by default that of an episode's start.
    """
    sets = [moved]
    for now, point in enumerate(points[1:], step + 1):
        sets.append(schedule.moved_after(now, sets[-1], point))
    return sets


def schedules_hash(schedules: Sequence[Schedule]) -> str:
    """Returns a SHA-256 of the times of the doors in some episodes."""
    return hashlib.sha256(repr([schedule.rows() for schedule in schedules]).encode("ascii")).hexdigest()
