"""Batched tree search in a learned model: Gumbel MuZero (Danihelka et al. 2022).

`B` is the number of roots, `N` = num_simulations + 1 the number of nodes of a tree, `A` the number of actions and `D`
the size of an embedding. The search draws no random numbers: noise is an argument. Of actions with equal scores the
first is taken.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np
import torch

from mazebench import kernels

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
    qvalues: np.ndarray  # [B, A] float32; actions not visited have the mixed value
    value: np.ndarray  # [B] float32, the mean over the root's visits


# Evaluates actions [B] int64 in the states of embeddings [B, D], and returns the embeddings that they lead to. Its
# arguments are the search's, and valid during the call.
RecurrentFn = Callable[[torch.Tensor, np.ndarray], tuple[Evaluation, torch.Tensor]]


class KernelModel(NamedTuple):
    """A model that consists of kernels.

    `search(model, first, tree, gumbel, visits, settings, embeddings)` is a kernel that calls `run_simulations` for some
    neighbouring roots, of which `first` is the index of the first one and `embeddings` `[n, D]` float32 are theirs.
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
    value_scale: float = 0.1,
    maxvisit_init: float = 50.0,
) -> SearchResult:
    """Searches by sequential halving at the root, deterministic visits in proportion to the improved policy below it.

    All actions are considered at the root. Values are not rescaled: their differences mean the same in all nodes.

    Args:
      root: the states to search from.
      model: predicts steps; a function is called once per simulation.
      num_simulations: 0 acts by the prior.
      gumbel: `[B, A]`, standard Gumbel noise, scaled as wanted; zeros to act without noise.
      value_scale: of completed q-values, beside logits.
      maxvisit_init: added to the visits of the most visited action, which scale q-values too.
    """
    batch_size, num_actions = root.prior_logits.shape
    noise = np.ascontiguousarray(gumbel, np.float32)
    settings = Settings(np.float32(value_scale), np.float32(maxvisit_init))
    visits = np.array(considered_visits(num_actions, num_simulations), np.int64)
    tree = np.empty((batch_size, num_simulations + 1), trees.node_type(num_actions))
    trees.plant(tree, *map(np.ascontiguousarray, (root.prior_logits, root.value)))
    if isinstance(model, KernelModel):
        # Some trees at a time, on all cores where there are trees enough; results do not depend on their number.
        def search_from(first: int) -> None:
            some = slice(first, first + _TREES_AT_ONCE)
            model.search(model.model, first, tree[some], noise[some], visits, settings, states[some])

        states, firsts = root.embedding.numpy(), range(0, batch_size, _TREES_AT_ONCE)
        num_threads = min(len(firsts), kernels.num_threads())
        if num_threads > 1:
            with ThreadPoolExecutor(num_threads) as threads:
                list(threads.map(search_from, firsts))
        else:
            list(map(search_from, firsts))
    else:
        # All trees together, the model on the device of the roots.
        def step(_, first, embeddings, parents, actions, index, evaluation):
            before = embeddings[torch.from_numpy(parents).to(every.device), every]
            found, embeddings[index] = model(before, actions)
            for part, values in zip(evaluation, found, strict=True):
                part[:] = values

        with torch.inference_mode():
            every = torch.arange(batch_size, device=root.embedding.device)
            embeddings = root.embedding.new_empty((num_simulations + 1, *root.embedding.shape))  # [N, B, D]
            embeddings[ROOT] = root.embedding
            run_simulations(step, None, 0, tree, noise, visits, settings, embeddings)

    action = np.empty(batch_size, np.int64)
    action_weights = np.empty((batch_size, num_actions), np.float32)
    qvalues = np.empty((batch_size, num_actions), np.float32)
    trees.decide(tree, noise, settings, action, action_weights, qvalues)
    return SearchResult(
        action, action_weights, tree["child_visits"][:, ROOT].copy(), qvalues, tree["value"][:, ROOT].copy()
    )


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


@kernels.compiled_by_callers
def run_simulations(
    step: Callable[..., None],
    model: Any,
    first: int,
    tree: np.ndarray,
    gumbel: np.ndarray,
    visits: np.ndarray,
    settings: Settings,
    states: Any,
) -> None:
    """Runs all simulations of a search: in kernels, or as a function of Python.

    Args:
      step: `step(model, first, states, parents, actions, index, evaluation)` takes the actions `[n]` in the states of
        the nodes `parents` `[n]`; writes the states of the nodes `index`, and the evaluation of the step.
      model, first, states: for `step`; `first` is the index of the first of the roots, whose states are given.
      tree: `[n, N]`, with expanded roots.
      gumbel: `[n, A]` float32, added to the scores of the roots' actions.
      visits: `[N - 1]` int64, the visits of the actions that each simulation considers at the roots.
      settings: of the selection.
    """
    num_trees, num_nodes = tree.shape
    actions, parents = np.empty(num_trees, np.int64), np.empty(num_trees, np.int64)
    evaluation = trees.empty_evaluation(num_trees, gumbel.shape[1])
    for index in range(1, num_nodes):
        # Descend from each root to an action that was not visited yet.
        trees.simulate(tree, index, gumbel, visits[index - 1], settings, actions, parents)

        # Take these actions in the model.
        step(model, first, states, parents, actions, index, evaluation)

        # Expand the nodes that they lead to, and update the values on the paths to the roots.
        trees.expand(tree, index, evaluation)
        trees.backward(tree, index)
