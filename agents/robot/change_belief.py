"""The belief of a robot about where its map is wrong, as a network tells it."""

from __future__ import annotations

import dataclasses

import numpy as np

from mazebench.agent import Interface

from .change_network import ChangeNetwork
from .occupancy import SURE
from .senses import Memory

_SURE = (0.005, 0.49)  # the least and the largest probability of a change; of two states, the shown one stays likelier
_PLACED = 0.95  # probability of the way in which the map lies, from which that one is believed


def reads_maps_of(interface: Interface) -> bool:
    """Returns whether maps are shown that have a pixel for each cell of 1 m, as those that the network learned on."""
    is_exact = interface.context_size == interface.size and interface.cell_size == 1.0
    return is_exact and "map" not in interface.hidden


@dataclasses.dataclass
class ChangeBelief:
    """The belief in one environment.

    The network is asked when a map is shown, and again when a cell is seen that is not as the map shows it.
    """

    network: ChangeNetwork
    prior: np.ndarray | None = (
        None  # [L, L] float, the probability of a wall; None while the map may lie in several ways
    )
    _asked: np.ndarray | None = None  # [L, L] bool, the cells that were seen when the network was asked
    _placement: tuple[int, int, int] | None = None  # of the map that it was asked about
    _walls: np.ndarray | None = None  # [L, L] float, the probability of a wall by that map as it lies

    def update(self, memory: Memory, is_new: bool) -> None:
        """Takes in what was seen, on the map before or on a new one."""
        placement = memory.belief.likeliest(_PLACED)
        if placement is None:
            self.prior = self._placement = None
            return
        if is_new or placement != self._placement or self._walls is None or self._asked is None:
            self._placement, self._walls = placement, memory.belief.laid(placement)[0]
            self._asked = np.zeros(self._walls.shape, dtype=bool)
            self.prior = None
        is_seen, is_wall = np.abs(memory.evidence) >= SURE, memory.evidence > 0
        differs = is_seen & (is_wall != (self._walls > 0.5)) & (self._walls < 1)
        if self.prior is not None and not (differs & ~self._asked).any():
            return

        # It reads the part of the grid that the map is of.
        rows, columns = (np.flatnonzero((self._walls < 1).any(axis)) for axis in (1, 0))
        inside = slice(rows[0] - 1, rows[-1] + 2), slice(columns[0] - 1, columns[-1] + 2)
        walls, seen, wall = self._walls[inside], is_seen[inside], is_wall[inside]
        changes = self.network.changes(walls > 0.5, seen & wall, seen & ~wall).clip(*_SURE)
        self.prior, self._asked = np.ones(self._walls.shape), is_seen
        self.prior[inside] = np.where(walls < 1, np.where(walls > 0.5, 1 - changes, changes), 1.0)
