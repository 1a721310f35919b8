"""Writes search.npz: what mctx, the reference implementation of MuZero's search in JAX, answers on random problems.

    pip install -e '.[agents,peers]' && python tests/golden/make_search_golden.py

A problem is a table: what the model predicts of each action in each of S states. A case is a search in it from B
states, with the random numbers that mctx drew for it. No two actions tie, so mctx's noise against ties has no effect.
"""

from __future__ import annotations

import json
import pathlib
from typing import Any

import jax
import jax.numpy as jnp
import mctx
import numpy as np

_FILE = pathlib.Path(__file__).parent / "search.npz"
_DIRICHLET_ALPHA = 0.3

# States, actions, and how rewards and discounts are drawn.
_PROBLEMS = {
    "random": (64, 6, "random"),
    "steps": (64, 6, "steps"),  # -1 a step and no discount, some of which end the episode
    "two": (32, 2, "random"),
    "many": (32, 18, "steps"),
}

_STEPWISE = {"value_scale": 0.03, "rescale_values": False}  # logits of 1.5 and more a step
_GUMBEL_CASES = [
    *[("random", 8, num_simulations, 1.0, {}) for num_simulations in (1, 2, 4, 8, 16, 32)],
    *[("steps", 8, num_simulations, 1.0, _STEPWISE) for num_simulations in (1, 2, 4, 8, 16, 32)],
    ("random", 8, 16, 0.0, {}),
    ("steps", 8, 16, 0.0, _STEPWISE),
    ("steps", 1, 16, 1.0, {}),
    ("random", 33, 16, 1.0, {"value_scale": 1.0, "maxvisit_init": 10.0, "rescale_values": False}),
    ("random", 8, 16, 1.0, {"use_mixed_value": False}),
    ("steps", 8, 16, 1.0, {**_STEPWISE, "use_mixed_value": False}),
    ("random", 8, 16, 1.0, {"max_num_considered_actions": 1}),
    ("random", 8, 16, 1.0, {"max_num_considered_actions": 3}),
    ("steps", 8, 32, 1.0, {"max_num_considered_actions": 4, "maxvisit_init": 5.0}),
    ("two", 8, 16, 1.0, {}),
    ("many", 8, 32, 1.0, {}),
    ("many", 8, 50, 1.0, {"value_scale": 0.02, "rescale_values": False}),
]
_PUCT_CASES = [
    *[("random", 8, num_simulations, {}) for num_simulations in (1, 2, 4, 8, 16, 32)],
    *[("steps", 8, num_simulations, {}) for num_simulations in (1, 2, 4, 8, 16, 32)],
    ("steps", 1, 16, {}),
    ("random", 33, 16, {"temperature": 0.0}),
    ("random", 8, 16, {"temperature": 0.25, "dirichlet_fraction": 0.0}),
    ("steps", 8, 32, {"pb_c_init": 2.5, "pb_c_base": 50.0, "dirichlet_fraction": 0.5}),
    ("two", 8, 16, {}),
    ("many", 8, 32, {}),
]


def main() -> None:
    rng = np.random.default_rng(0)
    problems = {name: _problem(rng, *sizes) for name, sizes in _PROBLEMS.items()}
    arrays = {f"problem/{name}/{key}": table for name, tables in problems.items() for key, table in tables.items()}
    cases = []
    for seed, (problem, batch_size, num_simulations, scale, options) in enumerate(_GUMBEL_CASES):
        states = rng.integers(len(problems[problem]["value"]), size=batch_size)
        answer = _gumbel(problems[problem], states, num_simulations, scale, options, jax.random.PRNGKey(seed))
        case = {"policy": "gumbel_muzero_policy", "problem": problem, "sims": num_simulations, "options": options}
        cases.append({"name": _name("gumbel", problem, batch_size, num_simulations, scale, options), **case})
        arrays |= {f"{cases[-1]['name']}/{key}": np.asarray(value) for key, value in answer.items()}
    for seed, (problem, batch_size, num_simulations, options) in enumerate(_PUCT_CASES, start=100):
        states = rng.integers(len(problems[problem]["value"]), size=batch_size)
        answer = _puct(problems[problem], states, num_simulations, options, jax.random.PRNGKey(seed))
        case = {"policy": "muzero_policy", "problem": problem, "sims": num_simulations, "options": options}
        cases.append({"name": _name("puct", problem, batch_size, num_simulations, options), **case})
        arrays |= {f"{cases[-1]['name']}/{key}": np.asarray(value) for key, value in answer.items()}
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


def _gumbel(tables, states, num_simulations, scale, options, key) -> dict[str, Any]:
    root, recurrent_fn = _root_and_model(tables, states)
    options = dict(options)
    considered = options.pop("max_num_considered_actions", 16)
    output = mctx.gumbel_muzero_policy(
        params=(),
        rng_key=key,
        root=root,
        recurrent_fn=recurrent_fn,
        num_simulations=num_simulations,
        qtransform=lambda tree, node: mctx.qtransform_completed_by_mix_value(tree, node, **options),
        max_num_considered_actions=considered,
        gumbel_scale=scale,
    )
    # Where its maxvisit_init is 1 - max(visits) and its scale 1, the transformation only completes.
    unscaled = {"value_scale": 1.0, "rescale_values": False, "use_mixed_value": options.get("use_mixed_value", True)}

    def complete(tree):
        most = tree.children_visits[0].max()
        return mctx.qtransform_completed_by_mix_value(tree, 0, maxvisit_init=1 - most, **unscaled)

    answer = {"gumbel": output.search_tree.extra_data.root_gumbel, "qvalues": jax.vmap(complete)(output.search_tree)}
    return {"states": states, **answer, **_answer(output)}


def _puct(tables, states, num_simulations, options, key) -> dict[str, Any]:
    root, recurrent_fn = _root_and_model(tables, states)
    output = mctx.muzero_policy(
        params=(),
        rng_key=key,
        root=root,
        recurrent_fn=recurrent_fn,
        num_simulations=num_simulations,
        dirichlet_alpha=_DIRICHLET_ALPHA,
        **options,
    )
    # As it draws them itself.
    action_key, dirichlet_key, _ = jax.random.split(key, 3)
    shape = root.prior_logits.shape
    noise = jax.random.dirichlet(dirichlet_key, jnp.full(shape[1:], _DIRICHLET_ALPHA), shape[:1])
    summary = output.search_tree.summary()
    value = summary.value[:, None]
    visited = summary.visit_counts > 0
    lowest = jnp.minimum(value, jnp.min(jnp.where(visited, summary.qvalues, value), axis=-1, keepdims=True))
    answer = {
        "dirichlet_noise": noise,
        "action_noise": jax.random.gumbel(action_key, shape, root.prior_logits.dtype),
        "qvalues": jnp.where(visited, summary.qvalues, lowest),
    }
    return {"states": states, **answer, **_answer(output)}


def _answer(output: mctx.PolicyOutput) -> dict[str, Any]:
    summary = output.search_tree.summary()
    return {
        "action": output.action,
        "action_weights": output.action_weights,
        "visit_counts": summary.visit_counts.astype(jnp.int32),
        "value": summary.value,
    }


if __name__ == "__main__":
    main()
