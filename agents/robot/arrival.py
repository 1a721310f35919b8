"""Earliest arrival in a building whose doors move at known times: Dijkstra's algorithm on arrival times.

A body that would come to a closed door waits before it until it opens. So who starts later never arrives earlier, and
one time for each cell is enough (Dreyfus 1969). Times are agent steps. `D` is the number of doors that move.
"""

from __future__ import annotations

import heapq
import math
from typing import NamedTuple

import numpy as np

from mazebench.kernels import compiled
from mazebench.maps.maze import Cell
from mazebench.tasks.schedule import Schedule

_STEPS_PER_METRE, _STEPS_FROM_REST = 2.05, 3.0  # of the oracle's drives on the dev mazes, along ways with diagonals
_SURELY = 0.3  # m more than the margin before a door's middle, at which it surely waits for the body
_DIAGONAL = math.sqrt(2.0)


class MovingDoors(NamedTuple):
    """The doors that move in an episode, in arrays."""

    door: np.ndarray  # [N, N] int, the index of the door that a cell is in; -1 for none
    numbers: np.ndarray  # [D] int, of the schedule
    is_open: np.ndarray  # [D] bool, before it moves
    times: np.ndarray  # [D, 3] int: first, away, period
    hold: float  # cells from a door at which the body keeps it from closing

    @classmethod
    def of(cls, schedule: Schedule, size: int) -> MovingDoors:
        """Returns those of a schedule in a maze of `size` cells a side."""
        numbers = sorted(schedule.times)
        door = np.full((size, size), -1)
        for index, number in enumerate(numbers):
            door[schedule.doors[number].cells()] = index
        times = [(each.first, each.away, each.period) for each in (schedule.times[number] for number in numbers)]
        is_open = [schedule.doors[number].is_open for number in numbers]
        return cls(
            door,
            np.array(numbers),
            np.array(is_open, dtype=bool),
            np.array(times).reshape(-1, 3),
            (schedule.margin + _SURELY) / schedule.cell_size,
        )


def earliest_way(
    walls: np.ndarray,
    doors: MovingDoors,
    start: Cell,
    goal: Cell,
    step: float,
    cell_size: float,
    pace: float = 1.0,
    *,
    waits: bool = True,
) -> tuple[list[Cell], float, int]:
    """Returns the cells of the way by which a body arrives first, its arrival, and the place of its first wait.

    The place is the index of the cell before a door that it waits for; that of the last cell if it does not wait. The
    way is empty, and the arrival infinite, where none leads to the goal.

    Args:
      walls: `[N, N]` bool, with all doors that move open.
      doors: those that move.
      start: the body's cell.
      goal: the goal.
      step: the time now.
      cell_size: m.
      pace: steps per cell, as a share of the usual ones.
      waits: whether it may wait; else it comes to each door when that is open.
    """
    pace *= _STEPS_PER_METRE * cell_size
    arrival, before, waited = _earliest(
        walls, doors.door, doors.is_open, doors.times, doors.hold, start, step + _STEPS_FROM_REST, pace, waits
    )
    if not np.isfinite(arrival[goal]):
        return [], math.inf, 0
    way = [goal]
    while way[-1] != start:
        way.append(divmod(int(before[way[-1]]), len(walls)))
    way.reverse()
    place = next((index for index, cell in enumerate(way[1:]) if waited[cell] > 0), len(way) - 1)
    return way, float(arrival[goal]), place


@compiled
def _earliest(
    walls: np.ndarray,
    door: np.ndarray,
    is_open: np.ndarray,
    times: np.ndarray,
    hold: float,
    start: tuple[int, int],
    step: float,
    pace: float,
    waits: bool,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Returns `[N, N]` three times: the arrival at each cell, the index of the cell before, and the steps waited."""
    size = len(walls)
    arrival = np.full(walls.shape, np.inf)
    waited = np.zeros(walls.shape)
    before = np.full(walls.shape, -1)
    arrival[start] = step
    queue = [(step, start[0] * size + start[1])]
    while queue:
        now, cell = heapq.heappop(queue)
        row, column = cell // size, cell % size
        if now > arrival[row, column]:
            continue
        for down in (-1, 0, 1):
            for right in (-1, 0, 1):
                r, c = row + down, column + right
                if walls[r, c] or (down != 0 and right != 0 and (walls[r, column] or walls[row, c])):
                    continue
                # Doors are entered straight.
                own, next_door = door[row, column], door[r, c]
                if (
                    down != 0
                    and right != 0
                    and (own >= 0 or next_door >= 0 or door[r, column] >= 0 or door[row, c] >= 0)
                ):
                    continue
                due = now + pace * (_DIAGONAL if down != 0 and right != 0 else 1.0)
                free = due
                if next_door >= 0 and next_door != own:
                    # A door that closes when the body is near waits for it.
                    early = max(due - hold * pace, step)
                    if free_from(early, is_open[next_door], times[next_door]) > early:
                        free = free_from(due, is_open[next_door], times[next_door])
                    if not waits and free > due:
                        continue
                if free < arrival[r, c]:
                    arrival[r, c], before[r, c], waited[r, c] = free, cell, free - due
                    heapq.heappush(queue, (free, r * size + c))
    return arrival, before, waited


@compiled
def free_from(step: float, is_open: bool, times: np.ndarray) -> float:
    """Returns the first time from `step` on at which a door can be passed; it may be very late."""
    first, away, period = times
    since = step - first
    phase = since % period
    if is_open:
        return step + away - phase if since >= 0 and phase < away else step
    if since < 0:
        return float(first)
    return step if phase < away else step + period - phase
