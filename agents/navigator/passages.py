"""Passages whose state a robot saw change: how long to wait for one that is closed.

A closed passage opens again with probability `OPENS`; if so, it stays closed for an exponential time with mean `STAYS`.
Given that it has been closed for s steps, it opens in the next step with the probability

    h(s) = q exp(-s / T) / (T (1 - q + q exp(-s / T))),  q = OPENS, T = STAYS.

Waiting a step more costs a step, and saves the detour with probability h. Since h falls, it is best to wait as long as
1 / h is less than the steps of the detour. So 1 / h is the cost of the passage: the expected time until it opens if it
had no memory. `benchmarks.fit_waiting` fits both numbers on train episodes.
"""

from __future__ import annotations

import math

import numpy as np

from ..robot.occupancy import SURE
from ..robot.senses import Memory

OPENS = 0.67  # share of the closed passages that open again
STAYS = 33.0  # steps, the mean time for which these stay closed
_STEPS_PER_METRE = 2.05  # of the navigator's drives
_FREE_ON_MAP = 0.5  # probability of a wall by the map, up to which a wall may be a closed passage
# Log odds of a wall, up to which a cell counts as free for a change. Rays that graze walls lead to -4 in some buildings
# in which nothing moves, and to -5 in none of 480 train episodes.
_FREE = -5.0
_NEAR = 2.0  # m, within which a robot sees what it has seen before
_LONGEST = 1e3  # steps, of a cost


def cost_of_closed(closed: np.ndarray, unseen: np.ndarray) -> np.ndarray:
    """Returns what passages cost, in steps, that were closed for some time when they were seen last.

    It is 1 / h at the time when the robot comes there, times the probability that it is still closed.

    Args:
      closed: steps for which each was seen closed.
      unseen: steps from then until the robot comes there.
    """
    at_last, on_arrival = (OPENS * np.exp(-steps / STAYS) for steps in (closed, closed + unseen))
    wait = STAYS * (1 - OPENS + on_arrival) / np.maximum(on_arrival, 1e-9)
    return np.minimum(wait, _LONGEST) * (1 - OPENS + on_arrival) / (1 - OPENS + at_last)


class Passages:
    """The observations of cells that were free and then wall, or the other way round; `[L, L]` arrays."""

    def __init__(self, memory: Memory):
        self.has_changed = False  # whether it saw any passage change
        self._step = 0
        self._evidence = memory.evidence.copy()  # after the last step
        self.free, self.wall = memory.evidence <= _FREE, memory.evidence >= SURE  # by what was seen last
        # The steps at which a cell was first seen as a wall, and last seen.
        self._closed, self._seen = np.zeros((2, *memory.evidence.shape), dtype=np.int64)

    def update(self, memory: Memory) -> None:
        """Takes note of what is seen now."""
        evidence = memory.evidence
        free, wall = evidence <= _FREE, evidence >= SURE
        self._step += 1
        self.has_changed = self.has_changed or bool((self.free & wall).any() or (self.wall & free).any())
        self._closed[wall & ~self.wall] = self._step
        self.free, self.wall = (self.free | free) & ~wall, (self.wall | wall) & ~free

        # What is seen changes the evidence, unless that is at its limit, as of what is near.
        row, column = memory.cell
        reach = math.ceil(_NEAR / memory.cell_size)
        near = slice(max(0, row - reach), row + reach + 1), slice(max(0, column - reach), column + reach + 1)
        self._seen[evidence != self._evidence] = self._step
        self._seen[near] = self._step
        self._evidence = evidence.copy()

    def costs(self, memory: Memory) -> np.ndarray | None:
        """Returns `[L, L]` float: metres that closed passages cost, infinite elsewhere; None if none has changed."""
        if not self.has_changed:
            return None
        closed = (memory.evidence >= SURE) & (memory.prior < _FREE_ON_MAP)
        costs = np.full(closed.shape, np.inf)
        away = np.abs(np.argwhere(closed) - memory.cell).sum(axis=1) * memory.cell_size * _STEPS_PER_METRE
        seen = self._seen[closed]
        costs[closed] = cost_of_closed(seen - self._closed[closed], self._step - seen + away) / _STEPS_PER_METRE
        return costs
