"""Prints the speed of the tree search beside that of mctx, as ratios taken in one run.

    python benchmarks/search_and_mctx.py [--seconds SECONDS]

Both search with the same network, a stand-in of about MMN's size, whose transition has other weights in each root as a
hypermodel's has. In both, network and search are compiled together and run in one thread. A rate is of simulations in a
second of processor time; a ratio is the median over rounds in which the two take turns. The extra `peers` brings mctx;
without it, only the search is measured.

`B` is the number of roots, `D` the size of a latent state, `A` the number of actions.
"""

from __future__ import annotations

import argparse
import contextlib
import functools
import importlib.util
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import torch
from mazebench_agents.common.actor import one_torch_thread
from mazebench_agents.mmn.kernel_layers import Linear, add_product, kernel, linear, normalize, rectify
from mazebench_agents.muzero.search import KernelModel, Root, gumbel_muzero_policy, run_simulations
from mazebench_agents.muzero.tree import ROOT, Evaluation, empty_evaluation

NUM_ACTIONS = 6
LATENT = 64
HIDDEN = 128
NUM_BINS = 65  # of values in [-64, 0]
NUM_SIMULATIONS = 16
_NUM_ROOTS = (1, 64, 256)
_ROUNDS = 7
_ANSWER = "--answer-for-mctx"  # asks this script for the rates of mctx, in a process of their own
# XLA would use a thread a core.
_ONE_THREAD = {
    "JAX_PLATFORMS": "cpu",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1",
    "OMP_NUM_THREADS": "1",
}

Search = Callable[[], Any]  # runs all simulations from all roots
Rate = Callable[[int, float], float]  # of a number of roots, and seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=3.0, help="of each figure")
    seconds = parser.parse_args().seconds / _ROUNDS
    print(f"{NUM_SIMULATIONS} simulations, one thread; simulations in a second of processor time\n")
    print("| roots | search | mctx | search / mctx |\n|---|---|---|---|")
    os.environ["OMP_NUM_THREADS"] = "1"  # of kernels
    with one_torch_thread(), mctx_rate() as theirs:
        for num_roots in _NUM_ROOTS:
            search, pairs = our_search(num_roots), []
            for _ in range(_ROUNDS):
                pairs.append((rate(search, num_roots, seconds), theirs(num_roots, seconds)))
            ours, others = (statistics.median(side) for side in zip(*pairs, strict=True))
            ratio = statistics.median(one / other for one, other in pairs)
            print(f"| {num_roots} | {ours:,.0f} | {others:,.0f} | {ratio:.2f} |", flush=True)


def rate(search: Search, num_roots: int, seconds: float) -> float:
    """Returns simulations per second of processor time."""
    search()
    count, begin = 0, time.process_time()
    while (elapsed := time.process_time() - begin) < seconds:
        search()
        count += 1
    return count * num_roots * NUM_SIMULATIONS / elapsed


def random_weights(num_roots: int) -> dict[str, np.ndarray]:
    """Returns the stand-in's weights, the same ones each time."""
    shapes = {
        "transition_1": (num_roots, LATENT + NUM_ACTIONS, LATENT),
        "transition_2": (num_roots, LATENT, LATENT),
        "head_1": (LATENT, HIDDEN),
        "head_2": (HIDDEN, HIDDEN),
        "outputs": (HIDDEN, NUM_ACTIONS + NUM_BINS + 1),  # policy, value, end
    }
    rng = np.random.default_rng(0)
    return {name: (rng.normal(size=shape) / shape[-2] ** 0.5).astype(np.float32) for name, shape in shapes.items()}


def random_latents(num_roots: int) -> np.ndarray:
    """Returns the latent states `[B, D]` of the roots."""
    return np.random.default_rng(0).normal(size=(num_roots, LATENT)).astype(np.float32)


class StandIn(NamedTuple):
    """The stand-in as kernels take it."""

    transition_1: np.ndarray  # [B, D + A, D]
    transition_2: np.ndarray  # [B, D, D]
    head_1: Linear
    head_2: Linear
    outputs: Linear


def our_search(num_roots: int) -> Search:
    """Returns a search of ours, by kernels."""
    # Tensors are aligned in memory, as those of a network are.
    weights = {name: torch.tensor(weight).numpy() for name, weight in random_weights(num_roots).items()}
    heads = {
        name: Linear(weights[name], np.zeros(weights[name].shape[1], np.float32))
        for name in ("head_1", "head_2", "outputs")
    }
    model = StandIn(weights["transition_1"], weights["transition_2"], **heads)
    latent, evaluation = random_latents(num_roots), empty_evaluation(num_roots, NUM_ACTIONS)
    predict(model, latent, evaluation)
    root = Root(evaluation.prior_logits, evaluation.value, torch.from_numpy(latent))
    gumbel = np.random.default_rng(0).gumbel(size=(num_roots, NUM_ACTIONS))
    return lambda: gumbel_muzero_policy(root, KernelModel(search_kernel, model), NUM_SIMULATIONS, gumbel)


@functools.partial(kernel, nogil=True)
def search_kernel(model, first, tree, gumbel, visits, settings, roots):
    """Runs all simulations from neighbouring roots, as `KernelModel` says."""
    states = np.empty((*tree.shape, LATENT), np.float32)
    states[:, ROOT] = roots
    run_simulations(step, model, first, tree, gumbel, visits, settings, states)


@kernel
def step(model, first, states, parents, actions, index, evaluation):
    """Takes a step, as `run_simulations` says: a residual layer with an input for each action."""
    num_trees = len(states)
    latent, hidden = np.empty((num_trees, LATENT), np.float32), np.empty((num_trees, LATENT), np.float32)
    for b in range(num_trees):
        weights = model.transition_1[first + b]
        latent[b] = states[b, parents[b]]
        hidden[b] = weights[LATENT + actions[b]]
        add_product(latent[b : b + 1], weights[:LATENT], hidden[b : b + 1])
        rectify(hidden[b])
        add_product(hidden[b : b + 1], model.transition_2[first + b], latent[b : b + 1])
        normalize(latent[b])
        states[b, index] = latent[b]
    predict(model, latent, evaluation)


@kernel
def predict(model: StandIn, latent: np.ndarray, evaluation: Evaluation) -> None:
    """Writes the predictions for latent states `[B, D]`."""
    hidden_1, hidden_2 = np.empty((len(latent), HIDDEN), np.float32), np.empty((len(latent), HIDDEN), np.float32)
    outputs = np.empty((len(latent), NUM_ACTIONS + NUM_BINS + 1), np.float32)
    linear(latent, model.head_1, hidden_1)
    rectify(hidden_1.reshape(-1))
    linear(hidden_1, model.head_2, hidden_2)
    rectify(hidden_2.reshape(-1))
    linear(hidden_2, model.outputs, outputs)
    one = np.float32(1.0)
    for b in range(len(latent)):
        evaluation.prior_logits[b] = outputs[b, :NUM_ACTIONS]
        logits = outputs[b, NUM_ACTIONS : NUM_ACTIONS + NUM_BINS]
        highest = np.max(logits)
        total = weighted = np.float32(0.0)
        for j in range(NUM_BINS):
            weight = np.exp(logits[j] - highest)
            total += weight
            weighted += weight * np.float32(j + 1 - NUM_BINS)
        evaluation.value[b] = weighted / total
        evaluation.reward[b] = -one
        evaluation.discount[b] = one / (one + np.exp(outputs[b, NUM_ACTIONS + NUM_BINS]))


@contextlib.contextmanager
def mctx_rate() -> Iterator[Rate]:
    """Yields a function that measures mctx in another process; it answers NaN where mctx is not installed."""
    if not all(importlib.util.find_spec(name) for name in ("jax", "mctx")):
        print("mctx is not measured: the extra `peers`, which brings it, is not installed", file=sys.stderr)
        yield lambda num_roots, seconds: float("nan")
        return
    with subprocess.Popen(
        [sys.executable, __file__, _ANSWER],
        env={**os.environ, **_ONE_THREAD},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:

        def ask(num_roots: int, seconds: float) -> float:
            process.stdin.write(json.dumps([num_roots, seconds]) + "\n")
            process.stdin.flush()
            return json.loads(process.stdout.readline())

        try:
            yield ask
        finally:
            process.stdin.close()


def answer_for_mctx() -> None:
    """Writes a rate for each line of standard input, a list of the number of roots and seconds, until it ends."""
    search_of = functools.cache(mctx_search)
    for line in sys.stdin:
        num_roots, seconds = json.loads(line)
        print(json.dumps(rate(search_of(num_roots), num_roots, seconds)), flush=True)


def mctx_search(num_roots: int) -> Search:
    """Returns a search of mctx."""
    import jax
    import jax.numpy as jnp
    import mctx

    def predict(weights, latent):
        hidden = jax.nn.relu(jax.nn.relu(latent @ weights["head_1"]) @ weights["head_2"])
        outputs = hidden @ weights["outputs"]
        value = jax.nn.softmax(outputs[:, NUM_ACTIONS:-1]) @ jnp.linspace(1 - NUM_BINS, 0, NUM_BINS)
        return outputs[:, :NUM_ACTIONS], value, jax.nn.sigmoid(outputs[:, -1])

    def recurrent_fn(weights, key, action, latent):
        inputs = jnp.concatenate([latent, jax.nn.one_hot(action, NUM_ACTIONS)], axis=1)  # [B, D + A]
        hidden = jax.nn.relu(jnp.einsum("bi,bio->bo", inputs, weights["transition_1"]))
        latent = jax.nn.standardize(latent + jnp.einsum("bi,bio->bo", hidden, weights["transition_2"]))
        prior_logits, value, end = predict(weights, latent)
        reward = jnp.full(num_roots, -1.0)
        output = mctx.RecurrentFnOutput(reward=reward, discount=1 - end, prior_logits=prior_logits, value=value)
        return output, latent

    @jax.jit
    def search(weights, key, latent):
        prior_logits, value, _ = predict(weights, latent)
        root = mctx.RootFnOutput(prior_logits=prior_logits, value=value, embedding=latent)
        transform = functools.partial(mctx.qtransform_completed_by_mix_value, rescale_values=False)
        output = mctx.gumbel_muzero_policy(weights, key, root, recurrent_fn, NUM_SIMULATIONS, qtransform=transform)
        summary = output.search_tree.summary()
        return output.action, output.action_weights, summary.visit_counts, summary.qvalues, summary.value

    weights = {name: jnp.asarray(weight) for name, weight in random_weights(num_roots).items()}
    latent = jnp.asarray(random_latents(num_roots))
    return lambda: jax.block_until_ready(search(weights, jax.random.PRNGKey(0), latent))


if __name__ == "__main__":
    if sys.argv[1:] == [_ANSWER]:
        answer_for_mctx()
    else:
        main()
