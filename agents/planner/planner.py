"""The paper's hard-coded strategy: plan once, then for each cell turn to it, drive straight, stop in it.

Zhao & Wong, appendix on robustness: it changes its orientation to the next target, moves forward along that direction,
and stops in the target cell. It has what MMN has not, the scale of the map and a position on it. It is rigid on
purpose: it neither aims again on the way nor plans again, so it breaks where its position is noisy.
"""

from __future__ import annotations

import dataclasses
import math
import pathlib

import numpy as np

from mazebench.agent import Interface, Observation
from mazebench.maps.maze import Cell

from . import reading


@dataclasses.dataclass
class _Plan:
    """Where one environment's agent is in its plan."""

    path: list[Cell]
    next: int = 1  # index in `path` of the cell it drives to
    turns: int = 0  # look actions still to take, positive to the left

    @property
    def target(self) -> Cell:
        """The cell it drives to: on a warped map start and goal may fall together."""
        return self.path[min(self.next, len(self.path) - 1)]

    def aim(self, state: list[float], size: int) -> None:
        """Chooses the look actions that point the body at the next cell from where it will have come to rest."""
        x, y = reading.centre(self.target, size)
        coast_x, coast_y = reading.coasting(state)
        bearing = math.atan2(y - state[reading.Y] - coast_y, x - state[reading.X] - coast_x)
        self.turns = round(reading.wrap(bearing - state[reading.YAW]) / reading.TURN_STEP)

    def action(self, state: list[float], size: int) -> int:
        """Turns as aimed, drives straight until the position reads as in the next cell, then aims at the one after."""
        arrived = not self.turns and reading.cell_of(state[reading.X], state[reading.Y], size) == self.target
        if arrived and self.next < len(self.path) - 1:
            self.next += 1
            self.aim(state, size)
        if not self.turns:
            return reading.FORWARD
        left = self.turns > 0
        self.turns -= 1 if left else -1
        return reading.LOOK_LEFT if left else reading.LOOK_RIGHT


class Planner:
    """Open loop between the cells of a path that is planned once a context."""

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> Planner:
        """`seed` and `checkpoint` have no meaning here."""
        return cls()

    @staticmethod
    def context_size(size: int) -> int:
        """The map at full resolution: cells are waypoints."""
        return size

    def initial_state(self, batch_size: int) -> list[_Plan]:
        """No plan yet: `act` makes one where an episode is first."""
        return [_Plan([]) for _ in range(batch_size)]

    def act(
        self, observation: Observation, is_first: np.ndarray, state: list[_Plan], explore: bool = False
    ) -> tuple[np.ndarray, list[_Plan]]:
        """Actions `[B]`, one environment after the other."""
        size = observation["context"].shape[-1]
        states = observation["state"].tolist()
        for slot in np.flatnonzero(is_first):
            state[slot] = _Plan(reading.plan(observation["context"][slot]))
            state[slot].aim(states[slot], size)
        return np.array([plan.action(values, size) for plan, values in zip(state, states, strict=True)]), state
