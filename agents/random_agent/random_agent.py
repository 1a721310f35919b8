"""Uniform random actions: the reference that says how much of a task is luck."""

from __future__ import annotations

import pathlib

import numpy as np

from mazebench.agent import Agent, Inputs, Interface


class RandomAgent(Agent):
    """Acts uniformly at random; the actions of an episode depend on its seed alone."""

    def __init__(self, num_actions: int):
        self._num_actions = num_actions

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> RandomAgent:
        """Returns a new agent; `seed` and `checkpoint` have no meaning here."""
        return cls(interface.num_actions)

    def initial_state(self, batch_size: int) -> list[np.random.Generator]:
        """Returns a generator for each environment, which `act` replaces where an episode begins."""
        return [np.random.default_rng(0) for _ in range(batch_size)]

    def act(
        self, inputs: Inputs, state: list[np.random.Generator], explore: bool = False
    ) -> tuple[np.ndarray, list[np.random.Generator]]:
        """Returns actions `[B]`, each from the generator of its episode."""
        for slot in np.flatnonzero(inputs.new_episode):
            state[slot] = np.random.default_rng(int(inputs.seed[slot]))
        return np.array([rng.integers(self._num_actions) for rng in state]), state
