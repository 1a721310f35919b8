"""The navigator: a classical robot that senses walls by its lidar, or by touch where there is none."""

from __future__ import annotations

import pathlib
from typing import Self

import numpy as np

from mazebench.agent import Agent, Inputs, Interface

from ..common.bounds import bounded
from ..robot.robot import Memory, Robot, believed_by_rule


class Navigator(Agent):
    """A classical robot: it localizes itself, maps what it senses, plans again at each step, and pursues its path."""

    def __init__(self, interface: Interface):
        """Acts in the environments of the interface."""
        self._robot = Robot(interface)

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> Self:
        """Returns an agent for the interface's mazes."""
        return cls(interface)

    @classmethod
    def context_size(cls, size: int) -> int:
        """Returns N: the map at full resolution."""
        return size

    def initial_state(self, batch_size: int) -> list[Memory | None]:
        """Returns no memories yet: one is made where an episode begins."""
        return [None] * batch_size

    def act(
        self, inputs: Inputs, state: list[Memory | None], explore: bool = False
    ) -> tuple[np.ndarray, list[Memory | None]]:
        """Returns actions `[B]`, for one environment after the other."""
        inputs = bounded(inputs)
        actions = np.zeros(len(state), dtype=np.int64)
        for slot, memory in enumerate(state):
            if inputs.active is None or inputs.active[slot]:
                state[slot] = known = self._robot.observe(memory, inputs, slot)
                actions[slot] = self._robot.command(known, *believed_by_rule(known))
        return actions, state
