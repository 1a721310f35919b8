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
from mazebench_agents.planner import observation as planner
from mazebench_agents.planner.pilot import Pilot

from mazebench.agent import Observation, SingleAgent
from mazebench.maps.maze import Cell

_SHOWN_WALL, _BUMPED, _BORDER = 10.0, 60.0, 1e6  # cells
_STILL = 0.25  # m/s
_STEPS = 3  # of standing still while driving, that tell of a wall
_POSITION_GAIN = 0.1  # weight of an observed position, as of `planner-closed-loop`
_INSIDE = 0.35  # cells from the centre of a cell in which the body is for sure
_DRIVES = {
    planner.FORWARD: 0.0,
    planner.BACKWARD: math.pi,
    planner.STRAFE_LEFT: math.pi / 2,
    planner.STRAFE_RIGHT: -math.pi / 2,
}


class BumpingPlanner(SingleAgent):
    """Marks walls where it is stopped, and plans around them."""

    def reset(self, observation: Observation) -> None:
        """Takes in a new goal; in a new episode, the map too."""
        context = observation["context"]
        if self.new_episode:
            self._cost = np.where(context[planner.GLOBAL_MAP] > 0.5, _SHOWN_WALL, 1.0)
            self._cost[[0, -1]] = self._cost[:, [0, -1]] = _BORDER
            self._still, self._action = 0, planner.LOOK_LEFT
            self._position = planner.centre(planner.start_cell(context), len(self._cost))
            self._velocity = (0.0, 0.0)
        self._goal, self._pilot = planner.marked_cell(context[planner.GOAL]), None

    def act(self, observation: Observation) -> int:
        """Returns an action."""
        body = planner.observed_body(observation["state"].tolist())
        size, velocity = len(self._cost), body.velocity()
        if self._action is not planner.LOOK_LEFT or self._pilot:
            moved = [(old + new) / 2 * planner.STEP_TIME for old, new in zip(self._velocity, velocity, strict=True)]
            x, y = (place + step for place, step in zip(self._position, moved, strict=True))
            self._position = x + _POSITION_GAIN * (body.x - x), y + _POSITION_GAIN * (body.y - y)
        self._velocity = velocity
        cell = planner.cell_of(*self._position, size)
        offset = np.subtract(self._position, planner.centre(cell, size))
        if np.abs(offset).max() < _INSIDE:
            self._cost[cell] = 1.0
        if self._action in _DRIVES:
            self._still = self._still + 1 if math.hypot(*velocity) < _STILL else 0
        if self._still >= _STEPS:
            self._mark(cell, offset, body.yaw + _DRIVES[self._action])
            self._still, self._pilot = 0, None
        if self._pilot is None:
            self._pilot = Pilot.along(self._path(cell), size)
        self._action = self._pilot.action(body._replace(x=self._position[0], y=self._position[1]))
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
