"""Uniform random actions: the reference that says how much of a task is luck."""

from __future__ import annotations

import pathlib

import numpy as np

from mazebench.agent import Interface, Observation

_BLOCK = 128  # actions drawn at a time for one episode


class RandomAgent:
    """Acts uniformly at random; an episode's actions depend on its seed and the agent's alone."""

    def __init__(self, num_actions: int, seed: int = 0):
        self._num_actions = num_actions
        self._seed = seed
        self._rngs: list[np.random.Generator] = []
        self._actions = np.zeros((0, _BLOCK), dtype=np.int64)
        self._drawn = np.zeros(0, dtype=np.int64)

    @classmethod
    def build(cls, interface: Interface, *, seed: int = 0, checkpoint: pathlib.Path | None = None) -> RandomAgent:
        """`checkpoint` has no meaning here."""
        return cls(interface.num_actions, seed)

    def initial_state(self, batch_size: int) -> None:
        """Streams of the agent's own in each of `batch_size` environments, until `seed_episodes` gives better ones."""
        self._rngs = [np.random.default_rng([self._seed, slot]) for slot in range(batch_size)]
        self._actions = np.zeros((batch_size, _BLOCK), dtype=np.int64)
        self._drawn = np.full(batch_size, _BLOCK)

    def seed_episodes(self, seeds: np.ndarray, mask: np.ndarray) -> None:
        """Starts a new stream where `mask` `[B]` says that an episode begins."""
        for slot in np.flatnonzero(mask):
            self._rngs[slot] = np.random.default_rng([self._seed, int(seeds[slot])])
            self._drawn[slot] = _BLOCK

    def act(
        self, observation: Observation, is_first: np.ndarray, state: None, explore: bool = False
    ) -> tuple[np.ndarray, None]:
        """Actions `[B]`, each episode's from its own stream."""
        for slot in np.flatnonzero(self._drawn == _BLOCK):
            self._actions[slot] = self._rngs[slot].integers(self._num_actions, size=_BLOCK)
            self._drawn[slot] = 0
        actions = self._actions[np.arange(len(self._drawn)), self._drawn]
        self._drawn += 1
        return actions, state
