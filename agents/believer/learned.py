"""A navigator that asks a network, trained on changed buildings, in which cells its map is probably wrong."""

from __future__ import annotations

import dataclasses
import pathlib
from typing import Self

import numpy as np

from mazebench.agent import Inputs, Interface

from ..navigator.navigator import Navigator, Robot
from ..robot.change_belief import ChangeBelief, reads_maps_of
from ..robot.change_network import SHIPPED, ChangeNetwork, load
from ..robot.senses import Memory


@dataclasses.dataclass
class AskingRobot(Robot):
    """The robot in one environment, with what the network told it; None where it does not ask."""

    changes: ChangeBelief | None = None


class LearnedBeliever(Navigator):
    """Plans as the navigator, over the walls of the map and the probability that each of them has changed.

    Where the map is drawn or hidden, has cells of another size than 1 m, or may lie in several ways, it is the
    navigator.
    """

    def __init__(self, interface: Interface, network: ChangeNetwork):
        """Asks the network, where maps have a pixel for each cell of 1 m."""
        super().__init__(interface)
        self._network = network if reads_maps_of(interface) else None

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> Self:
        """Returns an agent with the network of a checkpoint, by default of the one that ships.

        Raises:
          InputError: if the checkpoint can't be read, or is another agent's.
        """
        return cls(interface, load(checkpoint or SHIPPED))

    @classmethod
    def default_checkpoint(cls) -> pathlib.Path:
        """Returns the network that ships."""
        return SHIPPED

    def begin(self, memory: Memory, seed: int) -> Robot:
        """Returns the robot of an episode, which has not asked yet."""
        changes = None if self._network is None else ChangeBelief(self._network)
        return AskingRobot(memory, self._passages(memory), changes=changes)

    def estimate(self, robot: Robot, inputs: Inputs, slot: int) -> tuple[np.ndarray, np.ndarray]:
        """Returns what it plans on, with the network's prior probabilities of walls where it was asked."""
        assert isinstance(robot, AskingRobot)
        if robot.changes is None:
            return robot.memory.estimate()
        robot.changes.update(robot.memory, bool(inputs.new_context[slot]))
        return robot.memory.estimate(robot.changes.prior)
