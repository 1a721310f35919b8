"""Uniform random actions: the reference that says how much of a task is luck."""

from __future__ import annotations

import pathlib

import numpy as np

from mazebench.agent import Agent, Inputs, Interface
from mazebench.constants import DISCRETE, VELOCITIES


class RandomAgent(Agent):
    """Acts uniformly at random; the actions of an episode depend on its seed alone."""

    plays_actions = (*DISCRETE, *VELOCITIES)

    def __init__(self, interface: Interface):
        self._kind, self._shape = interface.actions, interface.action_shape

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> RandomAgent:
        """Returns a new agent; `seed` and `checkpoint` have no meaning here."""
        return cls(interface)

    def initial_state(self, batch_size: int) -> list[np.random.Generator]:
        """Returns a generator for each environment, which `act` replaces where an episode begins."""
        return [np.random.default_rng(0) for _ in range(batch_size)]

    def act(
        self, inputs: Inputs, state: list[np.random.Generator], explore: bool = False
    ) -> tuple[np.ndarray, list[np.random.Generator]]:
        """Returns actions, each from the generator of its episode."""
        for slot in np.flatnonzero(inputs.new_episode):
            state[slot] = np.random.default_rng(int(inputs.seed[slot]))
        if self._kind in DISCRETE:
            return np.array([rng.integers(len(DISCRETE[self._kind])) for rng in state]), state
        return np.array([rng.uniform(-1, 1, self._shape) for rng in state]), state
