"""The navigator without a map: what a robot with a lidar reaches where the map tells it nothing.

Use it as `mazebench eval --agent benchmarks.blank_map:WithoutMap --track stale --level 3 --split train`, and
`benchmarks.blank_map:WithoutMapAndGoal`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from mazebench_agents.navigator import Navigator

from mazebench.agent import Inputs
from mazebench.tasks.context import GLOBAL_MAP, GOAL, LOCAL_MAP


class WithoutMap(Navigator):
    """Gets a blank map: the border alone. Start and goal stay marked."""

    def act(self, inputs: Inputs, state: Any, explore: bool = False) -> tuple[np.ndarray, Any]:
        """Returns the navigator's actions `[B]` on the blank map."""
        context = inputs.observation["context"].copy()
        context[:, [GLOBAL_MAP, LOCAL_MAP]] = 0
        border = np.pad(np.zeros([side - 2 for side in context.shape[-2:]], bool), 1, constant_values=True)
        context[:, GLOBAL_MAP, border] = 1
        self.blank_goal(context[:, GOAL])
        return super().act(inputs._replace(observation=inputs.observation | {"context": context}), state, explore)

    def blank_goal(self, goal: np.ndarray) -> None:
        """Changes the goal's planes `[B, M, M]` in place, here not at all."""


class WithoutMapAndGoal(WithoutMap):
    """Gets a blank map on which the goal may be in any cell."""

    def blank_goal(self, goal: np.ndarray) -> None:
        """Marks all cells inside of the border."""
        goal[:] = 0
        goal[:, 1:-1, 1:-1] = 1
