"""A planner that learns of walls by driving into them: what it is worth to doubt the map without learning to.

Use it as `mazebench eval --agent benchmarks.bumping_planner:BumpingPlanner`, or in `benchmarks/wrong_maps.py`. It
drives as `planner-closed-loop` does. A shown wall costs as much as 10 cells, one that it drove into as much as 60. It
plans again where it stands still.
"""

from __future__ import annotations

import math

import numpy as np
import torch
from mazebench_agents.belief_planner.shortest_paths import cheapest_paths
from mazebench_agents.robot.body import BACKWARD, FORWARD, LOOK_LEFT, STRAFE_LEFT, STRAFE_RIGHT, observed_body
from mazebench_agents.robot.cells import marked_cell, nearest_cell, start_cell
from mazebench_agents.robot.odometry import DeadReckoning
from mazebench_agents.robot.pilot import Pilot

from mazebench.agent import Observation, SingleAgent
from mazebench.maps.maze import Cell, cell_to_point
from mazebench.tasks.context import GLOBAL_MAP, GOAL

_SHOWN_WALL, _BUMPED, _BORDER = 10.0, 60.0, 1e6  # cells
_STILL = 0.25  # m/s
_STEPS = 3  # of standing still while driving, that tell of a wall
_POSITION_GAIN = 0.1  # weight of an observed position, as of `planner-closed-loop`
_INSIDE = 0.35  # cells from the centre of a cell in which the body is for sure
_DRIVES = {
    FORWARD: 0.0,
    BACKWARD: math.pi,
    STRAFE_LEFT: math.pi / 2,
    STRAFE_RIGHT: -math.pi / 2,
}


class BumpingPlanner(SingleAgent):
    """Marks walls where it is stopped, and plans around them."""

    def reset(self, observation: Observation) -> None:
        """Takes in a new goal; in a new episode, the map too."""
        context = observation["context"]
        if self.new_episode:
            self._cost = np.where(context[GLOBAL_MAP] > 0.5, _SHOWN_WALL, 1.0)
            self._cost[[0, -1]] = self._cost[:, [0, -1]] = _BORDER
            self._still, self._action = 0, LOOK_LEFT
            self._odometry: DeadReckoning | None = None
            self._start = start_cell(context)
        self._goal, self._pilot = marked_cell(context[GOAL]), None

    def act(self, observation: Observation) -> int:
        """Returns an action."""
        observed, size = observed_body(observation["state"].tolist()), len(self._cost)
        if self._odometry is None:
            x, y = cell_to_point(self._start, size).tolist()
            body = observed._replace(x=x, y=y)
            self._odometry = DeadReckoning((x, y), body.velocity(), _POSITION_GAIN)
        else:
            body = self._odometry.update(observed)
        cell = nearest_cell(body.x, body.y, size)
        offset = np.array([body.x, body.y]) - cell_to_point(cell, size)
        if np.abs(offset).max() < _INSIDE:
            self._cost[cell] = 1.0
        if self._action in _DRIVES:
            self._still = self._still + 1 if math.hypot(*body.velocity()) < _STILL else 0
        if self._still >= _STEPS:
            self._mark(cell, offset, body.yaw + _DRIVES[self._action])
            self._still, self._pilot = 0, None
        if self._pilot is None:
            self._pilot = Pilot.along(self._path(cell), size)
        self._action = self._pilot.action(body)
        return self._action

    def _mark(self, cell: Cell, offset: np.ndarray, heading: float) -> None:
        """Marks the wall beside the body that lies ahead."""
        ahead = {(0, 1): (math.cos(heading), offset[0]), (0, -1): (-math.cos(heading), -offset[0])}
        ahead |= {(-1, 0): (math.sin(heading), offset[1]), (1, 0): (-math.sin(heading), -offset[1])}
        touched = {side: drives for side, (drives, nearer) in ahead.items() if drives > 0.3 and nearer > 0.14}
        if touched:
            down, right = max(touched, key=lambda side: touched[side])
            self._cost[cell[0] + down, cell[1] + right] = max(_BUMPED, self._cost[cell[0] + down, cell[1] + right])

    def _path(self, start: Cell) -> list[Cell]:
        """Returns a cheapest path to the goal."""
        begin = torch.full((1, *self._cost.shape), 1e9)
        begin[0][self._goal] = 0
        distance = cheapest_paths(torch.from_numpy(self._cost)[None].float(), begin)[0]
        path = [start]
        while path[-1] != self._goal:
            row, column = path[-1]
            beside = [(row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)]
            inside = [each for each in beside if all(0 <= place < len(self._cost) for place in each)]
            path.append(min(inside, key=lambda each: float(distance[each])))
        return path if len(path) > 1 else [start, start]
