"""Measures mctx's search with the network of `measure`, in JAX and in a process of its own.

It reads lines of JSON, lists of policy, number of roots and seconds, and writes a rate for each.
"""

from __future__ import annotations

import functools
import json
import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from .measure import LATENT, NUM_ACTIONS, NUM_BINS, NUM_SIMULATIONS, random_weights, rate


def main() -> None:
    """Answers until its input ends."""
    search_step = functools.cache(_search_step)
    for line in sys.stdin:
        policy, batch_size, seconds = json.loads(line)
        print(json.dumps(rate(search_step(policy, batch_size), batch_size, seconds)), flush=True)


def _search_step(policy: str, batch_size: int) -> Callable[[], Any]:
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
        reward = jnp.full(batch_size, -1.0)
        output = mctx.RecurrentFnOutput(reward=reward, discount=1 - end, prior_logits=prior_logits, value=value)
        return output, latent

    @jax.jit
    def search(weights, key, latent):
        prior_logits, value, _ = predict(weights, latent)
        root = mctx.RootFnOutput(prior_logits=prior_logits, value=value, embedding=latent)
        policy_fn = mctx.gumbel_muzero_policy if policy == "gumbel" else mctx.muzero_policy
        output = policy_fn(weights, key, root, recurrent_fn, NUM_SIMULATIONS)
        summary = output.search_tree.summary()
        return output.action, output.action_weights, summary.visit_counts, summary.qvalues, summary.value

    weights = {name: jnp.asarray(weight) for name, weight in random_weights(batch_size).items()}
    latent = jnp.asarray(np.random.default_rng(0).normal(size=(batch_size, LATENT)), jnp.float32)
    return lambda: jax.block_until_ready(search(weights, jax.random.PRNGKey(0), latent))


if __name__ == "__main__":
    main()
