"""The oracle: what a controller reaches that knows the true maze and its true pose."""

from __future__ import annotations

import pathlib
from typing import Self

import numpy as np

from mazebench.agent import Agent, Inputs, Interface
from mazebench.maps.maze import path_through_walls

from ..robot.body import observed_body
from ..robot.cells import nearest_cell
from ..robot.pilot import Pilot


class Oracle(Agent):
    """Pure pursuit of the shortest path on the true walls, from the true pose to the goal; it ignores landmarks."""

    needs_truth = True

    def __init__(self, cells_per_metre: float = 1.0):
        self._cells_per_metre = cells_per_metre

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> Self:
        """Returns an oracle for the scale of the mazes."""
        return cls(1 / interface.cell_size)

    def initial_state(self, batch_size: int) -> list[Pilot]:
        """Returns pilots that `act` replaces where an episode begins."""
        return [Pilot([]) for _ in range(batch_size)]

    def act(self, inputs: Inputs, state: list[Pilot], explore: bool = False) -> tuple[np.ndarray, list[Pilot]]:
        """Returns actions `[B]`, planned for one environment after the other."""
        truth = inputs.truth
        assert truth is not None, "an evaluation gives the truth to a class that declares needs_truth"
        size = truth.walls.shape[-1]
        poses = (truth.pose * [self._cells_per_metre, self._cells_per_metre, 1.0]).tolist()
        for slot in np.flatnonzero(inputs.new_context).tolist():
            x, y, _ = poses[slot]
            row, column = truth.goal[slot].tolist()
            path = path_through_walls(truth.walls[slot], nearest_cell(x, y, size), (row, column))
            state[slot] = Pilot.along(path, size, self._cells_per_metre)
        actions = np.zeros(len(state), dtype=np.int64)
        for slot, values in enumerate(inputs.observation["state"].tolist()):
            x, y, yaw = poses[slot]
            body = observed_body(values, self._cells_per_metre)
            actions[slot] = state[slot].action(body._replace(x=x, y=y, yaw=yaw))
        return actions, state
