"""A navigator that asks a network, trained on changed buildings, in which cells its map is probably wrong."""

from __future__ import annotations

import pathlib
from importlib import resources
from typing import Self

import numpy as np

from mazebench.agent import Inputs, Interface

from ..navigator.navigator import Navigator
from ..robot.change_network import NAME, ChangeNetwork, load
from ..robot.occupancy import SURE
from ..robot.senses import Memory

_SURE = (0.005, 0.49)  # the least and the largest probability of a change; of two states, the shown one stays likelier
_PRIOR_AREA = 1e9  # m^2: what was seen counts in the network alone


class LearnedBeliever(Navigator):
    """Plans as the navigator, over the walls of the map and the probability that each of them has changed.

    A network tells this probability from the map and from what was seen so far. It is asked when a map is shown, and
    again when a cell is seen that is not as the map shows it. Where the map is drawn, hidden, may lie in several
    ways, or has cells of another size than 1 m, the agent is the navigator.
    """

    def __init__(self, interface: Interface, network: ChangeNetwork):
        """Asks the network, where maps have a pixel for each cell of 1 m."""
        super().__init__(interface)
        is_exact = interface.context_size == interface.size and interface.cell_size == 1.0
        self._network = network if is_exact and "map" not in interface.hidden else None

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> Self:
        """Returns an agent with the network of a checkpoint, by default of the one that ships.

        Raises:
          InputError: if the checkpoint can't be read, or is another agent's.
        """
        return cls(interface, load(checkpoint or cls.default_checkpoint()))

    @classmethod
    def default_checkpoint(cls) -> pathlib.Path:
        """Returns the network that ships."""
        return pathlib.Path(str(resources.files("mazebench_assets") / "checkpoints" / f"{NAME}.safetensors"))

    def estimate(self, memory: Memory, inputs: Inputs, slot: int) -> tuple[np.ndarray, np.ndarray]:
        """Returns what it plans on, with the network's prior probabilities of walls."""
        placements, map_walls = memory.belief.placements, memory.belief.walls[0]
        if self._network is not None and not placements.any() and map_walls.shape == memory.evidence.shape:
            is_seen, is_wall, shown = np.abs(memory.evidence) >= SURE, memory.evidence > 0, map_walls > 0.5
            differs = is_seen & (is_wall != shown) & (map_walls < 1)
            if memory.asked is None or inputs.new_context[slot] or (differs & ~memory.asked).any():
                changes = self._network.changes(shown, is_seen & is_wall, is_seen & ~is_wall).clip(*_SURE)
                memory.prior = np.where(map_walls < 1, np.where(shown, 1 - changes, changes), 1.0)
                memory.prior_area, memory.asked = _PRIOR_AREA, is_seen
        return memory.estimate()
