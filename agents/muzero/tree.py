"""Search trees as arrays, and kernels that select, expand and back up in all trees of a batch.

`B` is the number of trees, `N` the number of nodes in each, `A` the number of actions. A tree is a row of an array
`[B, N]` of `node_type`; a node first expanded in simulation i, counted from 0, has index i + 1, the root has 0. All
arithmetic on values is in float32.

Functions that are called for each node of a path are inlined: if LLVM decides, a search takes a tenth longer.
"""

from __future__ import annotations

import functools
import math
from typing import Any, NamedTuple

import numpy as np

from mazebench.kernels import compiled, inlined

ROOT = 0
UNVISITED = -1

_ZERO = np.float32(0.0)
_ONE = np.float32(1.0)
_MINUS_INFINITY = np.float32(-np.inf)
_TINY = np.finfo(np.float32).tiny
_LEAST_SCORE = np.float32(-1e9)  # of an action that may be visited: above that of one that may not


@functools.cache
def node_type(num_actions: int) -> np.dtype:
    """Returns the type of a node. Before a node is expanded, or an action visited, its numbers are undefined."""
    return np.dtype(
        [
            ("visits", np.int32),  # 1 when expanded, and one more for each visit of an action
            ("raw_value", np.float32),  # the network's
            ("value", np.float32),  # the mean over the visits
            ("parent", np.int32),  # a node's index; undefined at the root, as are the next three
            ("parent_action", np.int32),  # which leads from the parent to the node
            ("reward", np.float32),  # of that action
            ("discount", np.float32),  # of that action
            ("children", np.int32, num_actions),  # indices of nodes, or UNVISITED
            ("child_visits", np.int32, num_actions),  # of actions
            ("prior_logits", np.float32, num_actions),
            ("prior_probs", np.float32, num_actions),
            ("qvalues", np.float32, num_actions),  # reward + discount * value of the child
        ],
        align=True,
    )


class Evaluation(NamedTuple):
    """A model's predictions for one step from B states, and for the states that it leads to."""

    reward: np.ndarray  # [B] float32
    discount: np.ndarray  # [B] float32, of the value after the step; 0 where the episode ends in it
    prior_logits: np.ndarray  # [B, A] float32
    value: np.ndarray  # [B] float32


class Settings(NamedTuple):
    """The weight of completed q-values, beside logits, in the selection of actions."""

    value_scale: np.float32
    maxvisit_init: np.float32


@inlined
def empty_evaluation(batch_size: int, num_actions: int) -> Evaluation:
    """Returns an evaluation, whose numbers are not defined yet."""
    return Evaluation(
        np.empty(batch_size, np.float32),
        np.empty(batch_size, np.float32),
        np.empty((batch_size, num_actions), np.float32),
        np.empty(batch_size, np.float32),
    )


@compiled
def plant(tree: np.ndarray, prior_logits: np.ndarray, value: np.ndarray) -> None:
    """Expands the roots, given the logits of their policies `[B, A]` and their values `[B]`."""
    for b in range(len(tree)):
        _expand(tree[b, ROOT], prior_logits[b], value[b])


@compiled
def simulate(
    tree: np.ndarray,
    index: int,
    gumbel: np.ndarray,
    considered_visit: int,
    settings: Settings,
    actions: np.ndarray,
    parents: np.ndarray,
) -> None:
    """Descends from each root to an action not yet visited, and attaches the node `index` there, not expanded yet.

    Writes the `actions` `[B]`, and the nodes that they leave as `parents` `[B]`. At the roots, `gumbel` `[B, A]` is
    added to scores, and only actions visited `considered_visit` times are considered.
    """
    scores = np.empty(gumbel.shape[1], np.float32)
    for b in range(len(tree)):
        parent = ROOT
        action = _root_action(tree[b, ROOT], gumbel[b], considered_visit, settings, scores)
        while tree[b, parent].children[action] != UNVISITED:
            parent = tree[b, parent].children[action]
            action = _interior_action(tree[b, parent], settings, scores)
        tree[b, parent].children[action] = index
        tree[b, index].parent = parent
        tree[b, index].parent_action = action
        actions[b], parents[b] = action, parent


@compiled
def expand(tree: np.ndarray, index: int, evaluation: Evaluation) -> None:
    """Expands the nodes that were attached last, those of this index."""
    for b in range(len(tree)):
        node = tree[b, index]
        node.reward, node.discount = evaluation.reward[b], evaluation.discount[b]
        _expand(node, evaluation.prior_logits[b], evaluation.value[b])


@compiled
def backward(tree: np.ndarray, index: int) -> None:
    """Updates the visits, q-values and mean values on the paths from the nodes of this index to the roots."""
    for b in range(len(tree)):
        child, value = index, tree[b, index].value
        while child != ROOT:
            node = tree[b, child]
            parent, action = tree[b, node.parent], node.parent_action
            parent.qvalues[action] = node.reward + node.discount * node.value
            parent.child_visits[action] += 1
            value = node.reward + node.discount * value
            count = np.float32(parent.visits)
            parent.value = (parent.value * count + value) / (count + _ONE)
            parent.visits += 1
            child = node.parent


@compiled
def decide(
    tree: np.ndarray,
    gumbel: np.ndarray,
    settings: Settings,
    actions: np.ndarray,
    action_weights: np.ndarray,
    qvalues: np.ndarray,
) -> None:
    """Writes the roots' `actions` `[B]`, improved policies `action_weights` `[B, A]`, completed `qvalues` `[B, A]`.

    The action is the best of the most visited ones.
    """
    scores = np.empty(gumbel.shape[1], np.float32)
    for b in range(len(tree)):
        root = tree[b, ROOT]
        actions[b] = _root_action(root, gumbel[b], _most_visits(root), settings, scores)
        for a in range(len(scores)):
            scores[a] += root.prior_logits[a]
        _softmax(scores, action_weights[b])
        _complete(root, qvalues[b])


@inlined
def _expand(node: Any, prior_logits: np.ndarray, value: np.float32) -> None:
    node.visits = 1
    node.raw_value = node.value = value
    for a in range(len(node.children)):
        node.children[a] = UNVISITED
        node.child_visits[a] = 0
        node.prior_logits[a] = prior_logits[a]
    _softmax(node.prior_logits, node.prior_probs)


@inlined
def _softmax(logits: np.ndarray, probs: np.ndarray) -> None:
    highest, total = _highest(logits), _ZERO
    for a in range(len(logits)):
        probs[a] = math.exp(logits[a] - highest)
        total += probs[a]
    for a in range(len(logits)):
        probs[a] /= total


@inlined
def _highest(values: np.ndarray) -> np.float32:
    highest = _MINUS_INFINITY
    for a in range(len(values)):
        highest = max(highest, values[a])
    return highest


@inlined
def _most_visits(node: Any) -> int:
    most = 0
    for a in range(len(node.child_visits)):
        most = max(most, node.child_visits[a])
    return most


@inlined
def _root_action(root: Any, gumbel: np.ndarray, considered_visit: int, settings: Settings, scores: np.ndarray) -> int:
    """Returns the best action by gumbel + logit + transformed q-value, and writes the last into `scores` `[A]`."""
    _transform(root, settings, scores)
    highest = _highest(root.prior_logits)
    best, best_score = 0, _MINUS_INFINITY
    for a in range(len(root.children)):
        score = max(_LEAST_SCORE, gumbel[a] + (root.prior_logits[a] - highest) + scores[a])
        if root.child_visits[a] == considered_visit and score > best_score:
            best, best_score = a, score
    return best


@inlined
def _interior_action(node: Any, settings: Settings, scores: np.ndarray) -> int:
    """Returns the action whose visits fall most short of the improved policy (Danihelka et al. 2022, section 5)."""
    _transform(node, settings, scores)
    for a in range(len(node.children)):
        scores[a] += node.prior_logits[a]
    _softmax(scores, scores)
    best, best_score = 0, _MINUS_INFINITY
    for a in range(len(node.children)):
        score = scores[a] - np.float32(node.child_visits[a]) / np.float32(node.visits)
        if score > best_score:
            best, best_score = a, score
    return best


@inlined
def _complete(node: Any, qvalues: np.ndarray) -> None:
    """Writes the node's `qvalues` `[A]`; actions not visited get the mixed value."""
    # The mean of the network's value and the visited actions' (Danihelka et al. 2022, appendix D).
    sum_probs, weighted = _ZERO, _ZERO
    for a in range(len(node.qvalues)):
        if node.child_visits[a] > 0:
            sum_probs += max(_TINY, node.prior_probs[a])
    for a in range(len(node.qvalues)):
        if node.child_visits[a] > 0:
            weighted += max(_TINY, node.prior_probs[a]) * node.qvalues[a] / sum_probs
    count = np.float32(node.visits)
    mixed = (node.raw_value + (count - _ONE) * weighted) / count
    for a in range(len(node.qvalues)):
        qvalues[a] = node.qvalues[a] if node.child_visits[a] > 0 else mixed


@inlined
def _transform(node: Any, settings: Settings, qvalues: np.ndarray) -> None:
    """Writes completed `qvalues` `[A]`, scaled by the visits of the most visited action."""
    _complete(node, qvalues)
    scale = (settings.maxvisit_init + np.float32(_most_visits(node))) * settings.value_scale
    for a in range(len(node.qvalues)):
        qvalues[a] *= scale
