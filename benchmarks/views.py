"""Agents that see or remember less: controls of what a sensor, or a memory, is worth to them.

mazebench eval --agent benchmarks.views:NarrowNavigator --track rebuilt --level 2 --split dev --actions velocity
mazebench eval --agent benchmarks.views:GreyMapPolicy --track building --sensors egocentric --split dev
mazebench eval --agent benchmarks.views:BlindMapper --track rebuilt --level 2 --split dev
mazebench eval --agent benchmarks.views:ForgetfulMapper --track rebuilt --level 2 --split dev
"""

from __future__ import annotations

from typing import Any

import numpy as np
from mazebench_agents.map_policy.map_policy import MapPolicy
from mazebench_agents.navigator.navigator import Navigator
from mazebench_agents.neural_mapper.network import REACH
from mazebench_agents.neural_mapper.neural_mapper import NeuralMapper, WrittenSenses
from mazebench_agents.neural_planner.neural_planner import NeuralPlanner
from mazebench_agents.robot.moving_body import MovingBody
from mazebench_agents.robot.senses import Senses

from mazebench.agent import Inputs, Interface

_GREY = 128  # of 255
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


class GreyMapPolicy(MapPolicy):
    """The map policy with pictures that are grey all over."""

    def act(self, inputs: Inputs, state: Any, explore: bool = False) -> tuple[np.ndarray, Any]:
        """Returns actions `[B]`."""
        grey = np.full_like(inputs.observation["egocentric"], _GREY)
        return super().act(inputs._replace(observation=inputs.observation | {"egocentric": grey}), state, explore)


class BelievingPlanner(NeuralPlanner):
    """The neural planner, told by a network where its map is probably wrong."""

    believes = True


class _BlindSenses(WrittenSenses):
    """Senses whose scans never meet a wall."""

    def write(self, evidence: np.ndarray, body: MovingBody, ranges: np.ndarray, deviation: float) -> None:
        super().write(evidence, body, np.full_like(ranges, REACH), deviation)


class BlindMapper(NeuralMapper):
    """The neural mapper with a lidar that sees nothing."""

    senses_class = _BlindSenses


class _ForgetfulSenses(WrittenSenses):
    """Senses that know the last scan alone."""

    def write(self, evidence: np.ndarray, body: MovingBody, ranges: np.ndarray, deviation: float) -> None:
        evidence[:] = 0.0
        super().write(evidence, body, ranges, deviation)


class ForgetfulMapper(NeuralMapper):
    """The neural mapper that forgets what it wrote before."""

    senses_class = _ForgetfulSenses
