"""The navigator without memory, which forgets at each new goal what it has seen of the building.

`mazebench eval --suite tracks-goals --agent benchmarks.no_memory:NavigatorWithoutMemory` plays the reference of what
memory is worth.
"""

from __future__ import annotations

from mazebench_agents.navigator.navigator import Navigator
from mazebench_agents.robot.map_matching import MapBelief
from mazebench_agents.robot.map_reading import read_map
from mazebench_agents.robot.senses import Memory, Senses

from mazebench.agent import Inputs, Interface


class NavigatorWithoutMemory(Navigator):
    """Drives as the navigator, but each leg with what it would know if the episode began there.

    It keeps what is observed: the exact pose and the velocity.
    """

    def __init__(self, interface: Interface):
        super().__init__(interface)
        self._senses = _ForgetfulSenses(interface, "navigator without memory")


class _ForgetfulSenses(Senses):
    """Senses that forget walls, searched cells and the drive at each new context of an episode."""

    def observe(self, memory: Memory | None, inputs: Inputs, slot: int) -> Memory:
        if memory is not None and inputs.new_context[slot] and not inputs.new_episode[slot]:
            reading = read_map(inputs.observation["context"][slot], self._size)
            belief = MapBelief(reading.walls, reading.goal, 1, None, self._size)
            memory = Memory(belief, memory.body, memory.deviation)  # of an exact pose, on a map that lies as the maze
        return super().observe(memory, inputs, slot)
