"""The navigator without memory, which forgets at each new goal what it has seen of the building.

`mazebench eval --suite tracks-goals --agent benchmarks.no_memory:NavigatorWithoutMemory` plays the reference of what
memory is worth.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from mazebench_agents.navigator.navigator import Navigator
from mazebench_agents.robot.map_matching import MapBelief
from mazebench_agents.robot.map_reading import read_map
from mazebench_agents.robot.senses import Memory

from mazebench.agent import Inputs


class NavigatorWithoutMemory(Navigator):
    """Drives as the navigator, but each leg with what it would know if the episode began there.

    It keeps what is observed: the exact pose and the velocity.
    """

    def act(self, inputs: Inputs, state: list[Any], explore: bool = False) -> tuple[np.ndarray, list[Any]]:
        for slot in np.flatnonzero(inputs.new_context & ~inputs.new_episode).tolist():
            memory, size = state[slot].memory, len(state[slot].memory.searched)
            reading = read_map(inputs.observation["context"][slot], size)
            belief = MapBelief(reading.walls, reading.goal, 1, None, size)  # of a map that lies as the maze
            state[slot] = type(state[slot])(Memory(belief, memory.body, memory.deviation, memory.cell_size))
        return super().act(inputs, state, explore)
