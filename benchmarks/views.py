"""A narrower view: the navigator with the lidar's rays that lie in a camera's view.

mazebench eval --agent benchmarks.views:NarrowNavigator --track rebuilt --level 2 --split dev --actions velocity
"""

from __future__ import annotations

import numpy as np
from mazebench_agents.navigator.navigator import Navigator
from mazebench_agents.robot.senses import Senses

from mazebench.agent import Inputs, Interface

_AHEAD = 3  # rays on each side of the one straight ahead: 79 degrees


class _NarrowSenses(Senses):
    """Senses with seven of the lidar's rays, and touch."""

    def __init__(self, interface: Interface, agent: str):
        super().__init__(interface, agent)
        self.feels = self.is_narrow = True

    def look(self, inputs: Inputs) -> Inputs:
        ranges = inputs.observation["lidar"].copy()
        ranges[:, _AHEAD + 1 : -_AHEAD] = np.nan
        return inputs._replace(observation=inputs.observation | {"lidar": ranges})


class NarrowNavigator(Navigator):
    """The navigator with the seven rays ahead; with actions `velocity`, it turns along its path as it drives."""

    needs_sensors = ("lidar",)
    senses_class = _NarrowSenses
