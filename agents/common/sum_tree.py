"""Sampling in proportion to priorities."""

from __future__ import annotations

import numpy as np


class SumTree:
    """Priorities of `capacity` items in a binary tree of sums: setting and sampling K items costs K log(capacity)."""

    def __init__(self, capacity: int):
        self._num_leaves = 1 << max(0, capacity - 1).bit_length()
        self._capacity = capacity
        # Node 1 is the root, node i has children 2 i and 2 i + 1, and the leaf of item j is node num_leaves + j.
        self._sums = np.zeros(2 * self._num_leaves)

    def priorities(self, items: np.ndarray) -> np.ndarray:
        """Returns the priorities `[K]` float of `items` `[K]`."""
        return self._sums[self._num_leaves + items]

    def set(self, items: np.ndarray, priorities: np.ndarray) -> None:
        """Gives `items` `[K]` new `priorities` `[K]`, not negative; an item that occurs twice gets the last one."""
        nodes = self._num_leaves + np.asarray(items)
        self._sums[nodes] = priorities
        while nodes.size and nodes[0] > 1:
            nodes = np.unique(nodes >> 1)
            self._sums[nodes] = self._sums[2 * nodes] + self._sums[2 * nodes + 1]

    def sample(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """Returns items `[count]`, one from each of `count` equal parts of the total (as Schaul et al. 2016)."""
        left = (np.arange(count) + rng.random(count)) * (self._sums[1] / count)
        nodes = np.ones(count, dtype=np.int64)
        while nodes[0] < self._num_leaves:
            nodes *= 2
            to_the_right = (left >= self._sums[nodes]) & (self._sums[nodes + 1] > 0)
            left -= np.where(to_the_right, self._sums[nodes], 0.0)
            nodes += to_the_right
        return np.minimum(nodes - self._num_leaves, self._capacity - 1)
