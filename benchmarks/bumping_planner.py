"""Planners that drive into shown walls at a cost and mark the walls that they feel, without a belief.

Call them as `mazebench eval --agent benchmarks.bumping_planner:BumpingPlanner`, or in `benchmarks/wrong_maps.py`.
`LatticePlanner` knows the mazes of the kind `dfs`, too. Both are baselines for robots that revise their map.
"""

from __future__ import annotations

import numpy as np
from mazebench_agents.robot.body import LOOK_LEFT, Body, observed_body
from mazebench_agents.robot.cells import marked_cell, nearest_cell
from mazebench_agents.robot.contacts import felt_walls
from mazebench_agents.robot.pilot import Pilot
from mazebench_agents.robot.planning import plan
from scipy import ndimage

from mazebench.agent import Observation, SingleAgent
from mazebench.tasks.context import GLOBAL_MAP, GOAL

# Probabilities of a wall, by which a cell costs 10 and 60 cells. Walls that are certain are never tried.
_SHOWN, _FELT, _CERTAIN = 0.9, 0.983, 1.0
_DEVIATION = 0.01  # cells, standard deviation of the position


class BumpingPlanner(SingleAgent):
    """Drives as `planner-closed-loop` does, in cells of 1 m, and plans again where it has felt a wall.

    It takes the observed position for a point of the maze, and a goal that is marked in a certain wall for one beside.
    """

    def reset(self, observation: Observation) -> None:
        """Takes in a new goal; in a new episode, the map too."""
        context = observation["context"]
        if self.new_episode:
            self._walls = self.believed(context[GLOBAL_MAP] > 0.5)
            self._walls[[0, -1]] = self._walls[:, [0, -1]] = _CERTAIN
            self._before: Body | None = None
            self._action = LOOK_LEFT
        beside = ndimage.distance_transform_edt(self._walls == _CERTAIN, return_distances=False, return_indices=True)
        self._goal = np.zeros(self._walls.shape)
        self._goal[tuple(beside[(slice(None), *marked_cell(context[GOAL]))])] = 1.0
        self._pilot: Pilot | None = None

    def act(self, observation: Observation) -> int:
        """Returns an action."""
        body, size = observed_body(observation["state"].tolist()), len(self._walls)
        if self._before is not None:
            self._mark_felt_walls(self._before, body)
        cell = nearest_cell(body.x, body.y, size)
        if self._walls[cell] < _CERTAIN:
            self._walls[cell] = 0.0
        if self._pilot is None:
            self._pilot = Pilot.along(plan(self._walls, self._goal, cell), size)
        self._before, self._action = body, self._pilot.action(body)
        return self._action

    @staticmethod
    def believed(shown: np.ndarray) -> np.ndarray:
        """Returns `[N, N]` float: the probability of a wall on a map of shown walls `[N, N]` bool."""
        return np.where(shown, _SHOWN, 0.0)

    def _mark_felt_walls(self, before: Body, body: Body) -> None:
        """Marks the walls that may have stopped the body in its last step; where one is new, it plans again."""
        for cell, _ in felt_walls(before, self._action, body, 1.0, _DEVIATION, len(self._walls)):
            if self._walls[cell] < _FELT:
                self._walls[cell], self._pilot = _FELT, None


class LatticePlanner(BumpingPlanner):
    """The same, and knows `dfs`: a cell in an odd row and column is free, one in an even row and column is a wall."""

    @staticmethod
    def believed(shown: np.ndarray) -> np.ndarray:
        """Returns `[N, N]` float: the probability of a wall on a map of shown walls `[N, N]` bool."""
        walls = BumpingPlanner.believed(shown)
        walls[1::2, 1::2], walls[::2, ::2] = 0.0, _CERTAIN
        return walls
