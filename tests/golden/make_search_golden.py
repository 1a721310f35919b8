"""Writes search.npz: answers on random problems by mctx, the reference implementation of MuZero's search in JAX.

    pip install -e '.[agents,peers]' && python tests/golden/make_search_golden.py

A problem is a table of the model's predictions for each action in each of S states. A case is a search in it from B
states, with the random numbers that mctx drew for it. No two actions tie, so mctx's noise against ties has no effect.
"""

from __future__ import annotations

import functools
import json
import pathlib
from typing import Any

import jax
import jax.numpy as jnp
import mctx
import numpy as np

_FILE = pathlib.Path(__file__).parent / "search.npz"

# States, actions, and how rewards and discounts are drawn.
_PROBLEMS = {
    "random": (64, 6, "random"),
    "steps": (64, 6, "steps"),  # -1 a step and no discount, some of which end the episode
    "two": (32, 2, "random"),
    "many": (32, 18, "steps"),
}

_STEPWISE = {"value_scale": 0.03}  # logits of 1.5 and more per step
_CASES = [
    *[("random", 8, num_simulations, 1.0, {}) for num_simulations in (1, 2, 4, 8, 16, 32)],
    *[("steps", 8, num_simulations, 1.0, _STEPWISE) for num_simulations in (1, 2, 4, 8, 16, 32)],
    ("random", 8, 16, 0.0, {}),
    ("steps", 8, 16, 0.0, _STEPWISE),
    ("steps", 1, 16, 1.0, {}),
    ("random", 33, 16, 1.0, {"value_scale": 1.0, "maxvisit_init": 10.0}),
    ("steps", 8, 32, 1.0, {"maxvisit_init": 5.0}),
    ("two", 8, 16, 1.0, {}),
    ("many", 8, 32, 1.0, {}),
    ("many", 8, 50, 1.0, {"value_scale": 0.02}),
]


def main() -> None:
    rng = np.random.default_rng(0)
    problems = {name: _problem(rng, *sizes) for name, sizes in _PROBLEMS.items()}
    arrays = {f"problem/{name}/{key}": table for name, tables in problems.items() for key, table in tables.items()}
    cases = []
    for seed, (problem, batch_size, num_simulations, scale, options) in enumerate(_CASES):
        states = rng.integers(len(problems[problem]["value"]), size=batch_size)
        answer = _answer(problems[problem], states, num_simulations, scale, options, jax.random.PRNGKey(seed))
        name = _name(problem, batch_size, num_simulations, scale, options)
        cases.append({"name": name, "problem": problem, "sims": num_simulations, "options": options})
        arrays |= {f"{name}/{key}": np.asarray(value) for key, value in answer.items()}
    np.savez_compressed(_FILE, cases=np.array(json.dumps(cases)), **arrays)
    print(f"{_FILE.name}: {len(cases)} cases, {_FILE.stat().st_size / 1024:.0f} KiB")


def _name(*parts: Any) -> str:
    options = [f"{key}={value}" for key, value in parts[-1].items()]
    return "-".join([*map(str, parts[:-1]), *options])


def _problem(rng: np.random.Generator, num_states: int, num_actions: int, kind: str) -> dict[str, np.ndarray]:
    shape = (num_states, num_actions)
    if kind == "steps":
        reward = np.full(shape, -1.0)
        discount = (rng.random(shape) > 0.15).astype(float)
        value = -10 * rng.random(num_states)
    else:
        reward = rng.normal(size=shape)
        discount = np.where(rng.random(shape) < 0.2, 0.0, rng.random(shape))
        value = rng.normal(size=num_states)
    return {
        "next_state": rng.integers(num_states, size=shape).astype(np.int32),
        "reward": reward.astype(np.float32),
        "discount": discount.astype(np.float32),
        "prior_logits": (1.5 * rng.normal(size=shape)).astype(np.float32),
        "value": value.astype(np.float32),
    }


def _root_and_model(tables: dict[str, np.ndarray], states: np.ndarray) -> tuple[mctx.RootFnOutput, Any]:
    table = {key: jnp.asarray(value) for key, value in tables.items()}

    def recurrent_fn(params, key, action, state):
        next_state = table["next_state"][state, action]
        output = mctx.RecurrentFnOutput(
            reward=table["reward"][state, action],
            discount=table["discount"][state, action],
            prior_logits=table["prior_logits"][next_state],
            value=table["value"][next_state],
        )
        return output, next_state

    embedding = jnp.asarray(states, jnp.int32)
    root = mctx.RootFnOutput(
        prior_logits=table["prior_logits"][embedding], value=table["value"][embedding], embedding=embedding
    )
    return root, recurrent_fn


def _answer(tables, states, num_simulations, scale, options, key) -> dict[str, Any]:
    root, recurrent_fn = _root_and_model(tables, states)
    transform = functools.partial(mctx.qtransform_completed_by_mix_value, rescale_values=False)
    output = mctx.gumbel_muzero_policy(
        params=(),
        rng_key=key,
        root=root,
        recurrent_fn=recurrent_fn,
        num_simulations=num_simulations,
        qtransform=functools.partial(transform, **options),
        max_num_considered_actions=root.prior_logits.shape[1],
        gumbel_scale=scale,
    )

    # Where its maxvisit_init is 1 - max(visits) and its scale 1, the transformation only completes.
    def complete(tree):
        return transform(tree, 0, value_scale=1.0, maxvisit_init=1 - tree.children_visits[0].max())

    summary = output.search_tree.summary()
    return {
        "states": states,
        "gumbel": output.search_tree.extra_data.root_gumbel,
        "qvalues": jax.vmap(complete)(output.search_tree),
        "action": output.action,
        "action_weights": output.action_weights,
        "visit_counts": summary.visit_counts.astype(jnp.int32),
        "value": summary.value,
    }


if __name__ == "__main__":
    main()
