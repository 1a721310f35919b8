"""Batched tree search in a learned model: Gumbel MuZero (Danihelka et al. 2022), MuZero (Schrittwieser et al. 2020).

`B` is the number of roots, `N` = num_simulations + 1 the number of nodes of a tree, `A` the number of actions and `D`
the size of an embedding. In each simulation a kernel descends all trees, the model evaluates one batch of B states, and
a kernel expands and backs up; a model that consists of kernels does all simulations in one call. The search draws no
random numbers: noise is an argument. Of actions with equal scores the first is taken, where mctx's MuZero adds a tiny
noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
import torch

from ..common import kernels
from . import tree as trees
from .tree import ROOT, Evaluation, Settings

_TREES_AT_ONCE = 32  # a task for a thread; what they read of their contexts stays in the processor's cache


class Root(NamedTuple):
    """The network's outputs for the states to search from."""

    prior_logits: np.ndarray  # [B, A] float32
    value: np.ndarray  # [B] float32
    embedding: torch.Tensor  # [B, D], on any device


class SearchResult(NamedTuple):
    """The results of a search for its roots."""

    action: np.ndarray  # [B] int64
    action_weights: np.ndarray  # [B, A] float32, the policy to learn
    visit_counts: np.ndarray  # [B, A] int32
    qvalues: np.ndarray  # [B, A] float32, those of actions not visited completed as the policy does
    value: np.ndarray  # [B] float32, the mean over the root's visits


# Evaluates actions [B] int64 in the states of embeddings [B, D], and returns the embeddings that they lead to. Its
# arguments are the search's, and valid during the call.
RecurrentFn = Callable[[torch.Tensor, np.ndarray], tuple[Evaluation, torch.Tensor]]


class KernelModel(NamedTuple):
    """A model that consists of kernels, which run the simulations themselves.

    `search(model, first, tree, gumbel, visits, settings, embeddings)` runs those of some neighbouring roots, of which
    `first` is the index of the first one. Their trees `[n, N]` have expanded roots; `gumbel` `[n, A]` float32 is added
    to the scores of the roots' actions; `visits` `[N - 1]` int64 are the visits of the actions that each simulation
    considers at the roots; `embeddings` `[n, D]` float32 are the roots'.
    """

    search: Callable[..., None]
    model: Any


Model = RecurrentFn | KernelModel


def gumbel_muzero_policy(
    root: Root,
    model: Model,
    num_simulations: int,
    gumbel: np.ndarray,
    *,
    max_num_considered_actions: int = 16,
    value_scale: float = 0.1,
    maxvisit_init: float = 50.0,
    rescale_values: bool = True,
    use_mixed_value: bool = True,
) -> SearchResult:
    """Searches by sequential halving at the root, deterministic visits in proportion to the improved policy below it.

    Args:
      root: the states to search from.
      model: predicts steps; a function is called once a simulation.
      num_simulations: 0 acts by the prior.
      gumbel: `[B, A]`, standard Gumbel noise, scaled as wanted; zeros to act without noise.
      max_num_considered_actions: at the root.
      value_scale: of completed q-values, beside logits.
      maxvisit_init: added to the visits of the most visited action, which scale q-values too.
      rescale_values: whether a node's q-values are brought to [0, 1] before they are scaled.
      use_mixed_value: whether q-values of actions not visited are completed by the mixed value, not the network's.
    """
    batch_size, num_actions = root.prior_logits.shape
    noise = np.empty((batch_size, num_actions), np.float32)
    noise[:] = gumbel
    settings = Settings(
        puct=False,
        value_scale=np.float32(value_scale),
        maxvisit_init=np.float32(maxvisit_init),
        rescale_values=rescale_values,
        use_mixed_value=use_mixed_value,
    )
    visits = considered_visits(min(max_num_considered_actions, num_actions), num_simulations)
    tree = _search(root, model, num_simulations, noise, visits, settings)
    action = np.empty(batch_size, np.int64)
    action_weights = np.empty((batch_size, num_actions), np.float32)
    qvalues = np.empty((batch_size, num_actions), np.float32)
    trees.gumbel_decision(tree, noise, settings, action, action_weights, qvalues)
    return SearchResult(
        action, action_weights, tree["child_visits"][:, ROOT].copy(), qvalues, tree["value"][:, ROOT].copy()
    )


def muzero_policy(
    root: Root,
    model: Model,
    num_simulations: int,
    dirichlet_noise: np.ndarray,
    action_noise: np.ndarray,
    *,
    dirichlet_fraction: float = 0.25,
    pb_c_init: float = 1.25,
    pb_c_base: float = 19652.0,
    temperature: float = 1.0,
) -> SearchResult:
    """Searches by upper confidence bounds (PUCT) everywhere; acts in proportion to visits ** (1 / temperature).

    Args:
      root: the states to search from.
      model: predicts steps; a function is called once a simulation.
      num_simulations: 0 acts by the prior with its noise.
      dirichlet_noise: `[B, A]`, a distribution over actions a root.
      action_noise: `[B, A]`, standard Gumbel noise, by which the action is drawn; zeros to take the most visited.
      dirichlet_fraction: of the noise in the roots' priors.
      pb_c_init: the exploration constant c1.
      pb_c_base: the exploration constant c2.
      temperature: 0 takes the most visited action.
    """
    prior = (1 - dirichlet_fraction) * _softmax(root.prior_logits) + dirichlet_fraction * dirichlet_noise
    noisy_root = root._replace(prior_logits=_log(prior.astype(np.float32)))
    settings = Settings(puct=True, pb_c_init=np.float32(pb_c_init), pb_c_base=np.float32(pb_c_base))
    none = np.zeros(root.prior_logits.shape, np.float32)
    tree = _search(noisy_root, model, num_simulations, none, [0] * num_simulations, settings)
    visit_counts = tree["child_visits"][:, ROOT].copy()
    action_weights = visit_counts.astype(np.float32) / np.float32(num_simulations) if num_simulations else prior
    action_weights = action_weights.astype(np.float32)
    qvalues = np.empty_like(action_weights)
    trees.puct_qvalues(tree, qvalues)
    action = np.argmax(action_noise + _tempered(action_weights, temperature), axis=-1)
    return SearchResult(action, action_weights, visit_counts, qvalues, tree["value"][:, ROOT].copy())


def considered_visits(num_considered: int, num_simulations: int) -> list[int]:
    """Returns how often an action must have been visited to be considered at the root, for each simulation.

    In sequential halving (Karnin et al. 2013), each phase visits all considered actions equally often, and the better
    half of them is considered in the next. They are those with as many visits as the phases have given so far.
    """
    if num_considered <= 1:
        return list(range(num_simulations))
    num_phases = math.ceil(math.log2(num_considered))
    sequence: list[int] = []
    done = 0  # visits of each action still considered
    while len(sequence) < num_simulations:
        num_visits = max(1, num_simulations // (num_phases * num_considered))
        for visit in range(done, done + num_visits):
            sequence += [visit] * num_considered
        done += num_visits
        num_considered = max(2, num_considered // 2)
    return sequence[:num_simulations]


@torch.inference_mode()
def _search(
    root: Root, model: Model, num_simulations: int, gumbel: np.ndarray, visits: list[int], settings: Settings
) -> np.ndarray:
    """Returns trees `[B, N]` after `num_simulations` simulations; `gumbel` and `visits` are as in `KernelModel`."""
    batch_size, num_actions = root.prior_logits.shape
    tree = np.empty((batch_size, num_simulations + 1), trees.node_type(num_actions))
    trees.plant(tree, *map(np.ascontiguousarray, (root.prior_logits, root.value)))
    if isinstance(model, KernelModel):
        _search_by_kernels(tree, model, gumbel, np.array(visits, np.int64), settings, root.embedding.numpy())
        return tree
    actions, parents = np.empty((2, batch_size), np.int64)
    embeddings = root.embedding.new_empty((num_simulations + 1, *root.embedding.shape))  # [N, B, D]
    embeddings[ROOT] = root.embedding
    for index in range(1, num_simulations + 1):
        # Descend from each root to an action that was not visited yet.
        trees.simulate(tree, index, gumbel, visits[index - 1], settings, actions, parents)

        # Take these actions in the model.
        rows = torch.from_numpy(parents * batch_size + np.arange(batch_size)).to(embeddings.device)
        parent_embeddings = embeddings.flatten(0, 1).index_select(0, rows)  # [B, D]
        evaluation, embeddings[index] = model(parent_embeddings, actions)

        # Expand the nodes that they lead to, and update the values on the paths to the roots.
        trees.expand(tree, index, Evaluation(*map(np.ascontiguousarray, evaluation)))
        trees.backward(tree, index)
    return tree


def _search_by_kernels(
    tree: np.ndarray,
    model: KernelModel,
    gumbel: np.ndarray,
    visits: np.ndarray,
    settings: Settings,
    embeddings: np.ndarray,
) -> None:
    """Runs all simulations, on all cores where there are trees enough; results do not depend on their number."""

    def search_from(first: int) -> None:
        some = slice(first, first + _TREES_AT_ONCE)
        model.search(model.model, first, tree[some], gumbel[some], visits, settings, embeddings[some])

    firsts = range(0, len(tree), _TREES_AT_ONCE)
    num_threads = min(len(firsts), kernels.num_threads())
    if num_threads <= 1:
        for first in firsts:
            search_from(first)
        return
    with ThreadPoolExecutor(num_threads) as threads:
        for ended in [threads.submit(search_from, first) for first in firsts]:
            ended.result()


def _softmax(logits: np.ndarray) -> np.ndarray:
    exponentials = np.exp(logits - logits.max(axis=-1, keepdims=True))
    return exponentials / exponentials.sum(axis=-1, keepdims=True)


def _log(probs: np.ndarray) -> np.ndarray:
    return np.log(np.maximum(probs, np.finfo(probs.dtype).tiny))


def _tempered(probs: np.ndarray, temperature: float) -> np.ndarray:
    """Returns the logits of `probs ** (1 / temperature)`, up to a constant."""
    logits = _log(probs)
    logits -= logits.max(axis=-1, keepdims=True)
    with np.errstate(over="ignore"):
        return logits / np.float32(max(float(np.finfo(np.float32).tiny), temperature))
