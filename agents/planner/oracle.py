"""The oracle: what a controller reaches that knows the true maze and its true pose."""

from __future__ import annotations

import numpy as np

from mazebench.agent import Agent, Inputs
from mazebench.maps.maze import path_through_walls

from . import observation
from .pilot import Pilot


class Oracle(Agent):
    """Pure pursuit of the shortest path on the true walls, from the true pose to the goal; it ignores landmarks."""

    needs_truth = True

    def initial_state(self, batch_size: int) -> list[Pilot]:
        """Returns pilots that `act` replaces where an episode begins."""
        return [Pilot([]) for _ in range(batch_size)]

    def act(self, inputs: Inputs, state: list[Pilot], explore: bool = False) -> tuple[np.ndarray, list[Pilot]]:
        """Returns actions `[B]`, planned for one environment after the other."""
        truth = inputs.truth
        assert truth is not None, "an evaluation gives the truth to a class that declares needs_truth"
        size = truth.walls.shape[-1]
        for slot in np.flatnonzero(inputs.new_context).tolist():
            x, y, _ = truth.pose[slot].tolist()
            row, column = truth.goal[slot].tolist()
            path = path_through_walls(truth.walls[slot], observation.cell_of(x, y, size), (row, column))
            state[slot] = Pilot.along(path, size)
        actions = np.zeros(len(state), dtype=np.int64)
        for slot, values in enumerate(inputs.observation["state"].tolist()):
            x, y, yaw = truth.pose[slot].tolist()
            actions[slot] = state[slot].action(observation.observed_body(values)._replace(x=x, y=y, yaw=yaw))
        return actions, state
