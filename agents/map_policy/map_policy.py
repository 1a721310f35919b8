"""The map policy: it reads the picture and the map, at a pose that it is told, and has no senses written by hand.

docs/agents/map_policy.md describes the network and its training.
"""

from __future__ import annotations

import copy
from typing import ClassVar, Self

import cv2
import numpy as np

from mazebench.agent import Inputs, Interface
from mazebench.errors import UnplayableError
from mazebench.tasks.context import GLOBAL_MAP, GOAL

from ..neural_planner.plan_reader import PlanReader, Robot
from ..robot.body import Body, observed_body
from .map_policy_config import MapPolicyConfig
from .network import PICTURE_SIZE, MapNetwork


class MapPolicy(PlanReader):
    """Reads the map once a leg, and acts by what it read around its pose, the picture and its motion."""

    name: ClassVar[str] = "map-policy"
    needs_sensors = ("egocentric",)
    needs_shown = ("map", "goal")
    default_config: ClassVar[MapPolicyConfig] = MapPolicyConfig()
    network: MapNetwork

    @classmethod
    def make_network(cls, config: MapPolicyConfig, context_size: int) -> MapNetwork:
        """Returns a new network, which reads maps of any size."""
        return MapNetwork(config.channels, config.read_steps, config.hidden)

    def for_interface(self, interface: Interface) -> Self:
        """Returns an agent with the same network for an interface's cells."""
        if interface.context_size != interface.size:
            expected = f"expected maps with a pixel per cell, found {interface.context_size} pixels"
            raise UnplayableError(f"agent {self.name!r}: {expected} for {interface.size} cells")
        agent = copy.copy(self)
        agent._cell_size = interface.cell_size
        return agent

    def observe(self, memory: np.ndarray | None, inputs: Inputs, slot: int) -> np.ndarray:
        """Returns the map as it is read, `[2, L, L]` uint8."""
        if memory is not None and not inputs.new_context[slot]:
            return memory
        planes = inputs.observation["context"][slot, [GLOBAL_MAP, GOAL]]
        return np.rint(255 * planes.clip(0, 1)).astype(np.uint8)

    def bodies(self, robots: list[Robot], observed: np.ndarray) -> list[Body]:
        """Returns the bodies as they are observed."""
        return [observed_body(state, 1 / self._cell_size) for state in observed.tolist()]

    def grid(self, memory: np.ndarray) -> np.ndarray:
        """Returns the map."""
        return memory

    def sights(self, robots: list[Robot], bodies: list[Body], inputs: Inputs, slots: list[int]) -> np.ndarray:
        """Returns the pictures, `[K, 32, 32, 3]` uint8: means of the observed ones' pixels."""
        pictures = inputs.observation["egocentric"][slots]
        size = (PICTURE_SIZE, PICTURE_SIZE)
        return np.array([cv2.resize(each, size, interpolation=cv2.INTER_AREA) for each in pictures], np.uint8).reshape(
            -1, *size, 3
        )
