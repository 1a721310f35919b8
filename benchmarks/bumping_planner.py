"""Planners that doubt the map without a belief: a shown wall is a detour, and a wall that was felt is a longer one.

Call them as `mazebench eval --agent benchmarks.bumping_planner:BumpingPlanner`, or in `benchmarks/wrong_maps.py`.
`LatticePlanner` knows the mazes of the kind `dfs`, too. A robot that revises its map must be better than both.
"""

from __future__ import annotations

import numpy as np
from mazebench_agents.robot.body import LOOK_LEFT, Body, observed_body
from mazebench_agents.robot.cells import marked_cell, nearest_cell, start_cell
from mazebench_agents.robot.contacts import felt_walls
from mazebench_agents.robot.odometry import DeadReckoning
from mazebench_agents.robot.pilot import Pilot
from mazebench_agents.robot.planning import plan

from mazebench.agent import Observation, SingleAgent
from mazebench.maps.maze import cell_to_point
from mazebench.tasks.context import GLOBAL_MAP, GOAL

# Probabilities of a wall, by which a cell costs 10 and 60 cells.
_SHOWN, _FELT = 0.9, 0.983
_POSITION_GAIN = 0.1  # weight of an observed position against the one predicted from velocities
_DEVIATION = 0.01  # cells, standard deviation of the position


class BumpingPlanner(SingleAgent):
    """Drives as `planner-closed-loop` does, in cells of 1 m, and plans again where it has felt a wall."""

    def reset(self, observation: Observation) -> None:
        """Takes in a new goal; in a new episode, the map too."""
        context = observation["context"]
        if self.new_episode:
            shown = context[GLOBAL_MAP] > 0.5
            self._walls = self.believed(shown)
            self._walls[[0, -1]] = self._walls[:, [0, -1]] = 1.0
            self._dead_reckoning: DeadReckoning | None = None
            self._start, self._action = start_cell(context), LOOK_LEFT
        self._goal = np.zeros(self._walls.shape)
        self._goal[marked_cell(context[GOAL])] = 1.0
        self._pilot: Pilot | None = None

    def act(self, observation: Observation) -> int:
        """Returns an action."""
        size = len(self._walls)
        body = self._estimate(observed_body(observation["state"].tolist()))
        cell = nearest_cell(body.x, body.y, size)
        if self._walls[cell] < 1:
            self._walls[cell] = 0.0
        if self._pilot is None:
            self._pilot = Pilot.along(plan(self._walls, self._goal, cell), size)
        self._action = self._pilot.action(body)
        return self._action

    @staticmethod
    def believed(shown: np.ndarray) -> np.ndarray:
        """Returns `[N, N]` float: the probability of a wall on a map of shown walls `[N, N]` bool."""
        return np.where(shown, _SHOWN, 0.0)

    def _estimate(self, observed: Body) -> Body:
        """Returns the body at its estimated position; marks the walls that have stopped it on its way there."""
        if self._dead_reckoning is None:
            x, y = cell_to_point(self._start, len(self._walls)).tolist()
            self._dead_reckoning = DeadReckoning((x, y), observed.velocity(), _POSITION_GAIN)
            self._body = observed._replace(x=x, y=y)
            return self._body
        before, self._body = self._body, self._dead_reckoning.update(observed)
        for cell, _ in felt_walls(before, self._action, self._body, 1.0, _DEVIATION, len(self._walls)):
            if self._walls[cell] < _FELT:
                self._walls[cell], self._pilot = _FELT, None
        return self._body


class LatticePlanner(BumpingPlanner):
    """The same, and knows of the kind `dfs` that rooms, at odd rows and columns, are free, and pillars are walls."""

    @staticmethod
    def believed(shown: np.ndarray) -> np.ndarray:
        """Returns `[N, N]` float: the probability of a wall on a map of shown walls `[N, N]` bool."""
        walls = BumpingPlanner.believed(shown)
        walls[1::2, 1::2], walls[::2, ::2] = 0.0, 1.0
        return walls
