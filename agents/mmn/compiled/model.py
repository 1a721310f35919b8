"""A search in one call: all simulations of a model that is a kernel.

`B` is the number of roots, `N` of nodes of each, `D` the size of a latent state, `H` of the transition's hidden layer.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import torch

from ...common import kernels
from ...muzero.search import Root, SearchableModel
from ...muzero.tree import ROOT, Settings, expand_and_backward, simulate

_kernel = functools.partial(kernels.compiled, fused=True, nogil=True)
_TREES_AT_ONCE = 32  # a task for a thread; what they read of their contexts stays in the processor's cache


class CompiledModel(SearchableModel):
    """A model for the search from some roots, of two kernels.

    `step(model, first, embeddings, parents, actions, index, numbers)` is called for n neighbouring roots at a time.
    From the states `embeddings[:, parents]` of the roots from `first` on, it writes those after `actions` into
    `embeddings[:, index]`, and the predictions into `numbers`, as `tree.expand_and_backward` takes them.
    `arrive(model, first, embeddings, index, numbers)` gets the latent states in `embeddings[:, index]`, and writes the
    rest. `embeddings` is `[n, N, D + H]` float32; the other arrays may be longer.
    """

    def __init__(self, model: Any, num_hidden: int, step: Callable[..., None], arrive: Callable[..., None]):
        """Takes the kernels' first argument, H, and the kernels; `step` is not compiled yet."""
        nodes, actions = np.zeros((1, 1, 1), np.float32), np.zeros(1, np.int64)
        self._step = kernels.first_class(step, (model, 0, nodes, actions, actions, 0, nodes[0]), fused=True)
        self._model, self._num_hidden, self._arrive = model, num_hidden, arrive

    def root(self, latent: torch.Tensor) -> Root:
        """Returns the root of a search from latent states `[B, D]`."""
        num_latent = latent.shape[-1]
        embedding = np.empty((len(latent), 1, num_latent + self._num_hidden), np.float32)
        embedding[:, 0, :num_latent] = latent.numpy()
        numbers = np.empty((len(latent), 9), np.float32)
        self._arrive(self._model, 0, embedding, 0, numbers)
        return Root(numbers[:, 3:], numbers[:, 2], torch.from_numpy(embedding[:, 0]))

    def search(
        self, tree: np.ndarray, gumbel: np.ndarray, visits: np.ndarray, settings: Settings, embedding: torch.Tensor
    ) -> None:
        """Runs all simulations, on all cores where there are trees enough; results do not depend on their number."""
        roots, shared = embedding.numpy(), (visits, settings, self._step, self._model)

        def search_from(first: int) -> None:
            some = slice(first, first + _TREES_AT_ONCE)
            _search(tree[some], gumbel[some], roots[some], first, *shared)

        firsts = range(0, len(tree), _TREES_AT_ONCE)
        if (num_threads := min(len(firsts), kernels.num_threads())) <= 1:
            for first in firsts:
                search_from(first)
            return
        with ThreadPoolExecutor(num_threads) as threads:
            for ended in [threads.submit(search_from, first) for first in firsts]:
                ended.result()


@_kernel
def _search(
    tree: np.ndarray,
    gumbel: np.ndarray,
    roots: np.ndarray,
    first: int,
    visits: np.ndarray,
    settings: Settings,
    step: Callable[..., None],
    model: Any,
) -> None:
    """Searches from neighbouring roots, of which `first` is the index of the first one."""
    num_trees, num_nodes = tree.shape
    actions, parents = np.empty(num_trees, np.int64), np.empty(num_trees, np.int64)
    numbers = np.empty((num_trees, 3 + gumbel.shape[1]), np.float32)
    states = np.empty((num_trees, num_nodes, roots.shape[1]), np.float32)
    states[:, ROOT] = roots
    for index in range(1, num_nodes):
        simulate(tree, index, gumbel, visits[index - 1], settings, actions, parents)
        step(model, first, states, parents, actions, index, numbers)
        expand_and_backward(tree, index, numbers)
