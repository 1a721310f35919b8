"""The neural planner: senses written by hand, a plan over costs that are learned, and a learned policy that drives.

docs/agents/neural_planner.md describes the network and both ways to train it.
"""

from __future__ import annotations

import copy
from typing import ClassVar, Self

import numpy as np

from mazebench.agent import Inputs, Interface, Report

from ..robot.body import Body
from ..robot.motion import moved_in_the_open
from ..robot.rays import ranges_to
from ..robot.senses import Memory, Senses, report
from .network import NUM_RANGES, REACH, PlannerNetwork, grid_bytes
from .neural_planner_config import NeuralPlannerConfig
from .plan_reader import ActorState, PlanReader, Robot

_WALL = 0.5  # probability from which a cell is a wall for these ranges


class NeuralPlanner(PlanReader):
    """Plans on what its senses tell, every few steps, and acts by a policy that reads the plan."""

    name: ClassVar[str] = "neural-planner"
    default_config: ClassVar[NeuralPlannerConfig] = NeuralPlannerConfig()
    network: PlannerNetwork
    _senses: Senses

    @classmethod
    def make_network(cls, config: NeuralPlannerConfig, context_size: int) -> PlannerNetwork:
        """Returns a new network, which plans on grids of any size."""
        return PlannerNetwork(config.channels, config.hidden, config.ways)

    def for_interface(self, interface: Interface) -> Self:
        """Returns an agent with the same network, whose senses are those in the environments of an interface."""
        agent = copy.copy(self)
        agent._senses, agent._cell_size = Senses(interface, self.name), interface.cell_size
        return agent

    def report(self, state: ActorState) -> Report:
        """Returns where the robots are on the maps, by the likeliest way in which these may lie."""
        return report(robot.memory if robot else None for robot in state.robots)

    def look(self, inputs: Inputs) -> Inputs:
        """Returns inputs with ranges, which a robot without a lidar reads from its pictures."""
        return self._senses.look(inputs)

    def observe(self, memory: Memory | None, inputs: Inputs, slot: int) -> Memory:
        """Returns the memory after an observation."""
        return self._senses.observe(memory, inputs, slot)

    def bodies(self, robots: list[Robot], observed: np.ndarray) -> list[Body]:
        """Returns the bodies as they are localized."""
        return [robot.memory.body for robot in robots]

    def grid(self, memory: Memory) -> np.ndarray:
        """Returns the network's input for what is known of walls and goal, `[4, L, L]` uint8."""
        walls, goal = memory.estimate()
        return grid_bytes(memory.prior, walls, memory.evidence, goal)

    def sights(self, robots: list[Robot], bodies: list[Body], inputs: Inputs, slots: list[int]) -> np.ndarray:
        """Returns ranges to the walls around the bodies, `[K, 32]` float32, with those that were seen last."""
        ranges = [
            ranges_to(robot.memory.estimate()[0] > _WALL, body.x, body.y, body.yaw, NUM_RANGES, REACH)
            for robot, body in zip(robots, bodies, strict=True)
        ]
        return np.array(ranges, dtype=np.float32).reshape(-1, NUM_RANGES)

    def command(self, memory: Memory, action: int) -> None:
        """Remembers the action, and where it should bring the body if no wall is in the way."""
        body = memory.body
        vx, vy = (self._cell_size * speed for speed in body.velocity())
        x, y, _, _ = moved_in_the_open(vx, vy, body.yaw, action)
        memory.command(action, (body.x + x / self._cell_size, body.y + y / self._cell_size))
