"""Tree search: against mctx's answers, and by hand."""

import json
import pathlib

import numpy as np
import pytest
import torch
from mazebench_agents.muzero.search import Root, considered_visits, gumbel_muzero_policy
from mazebench_agents.muzero.tree import Evaluation

torch.set_num_threads(1)  # two that share a core with other tests wait for each other

GOLDEN = np.load(pathlib.Path(__file__).parent / "golden" / "search.npz")  # from mctx 0.0.71, on random tables
CASES = {case["name"]: case for case in json.loads(str(GOLDEN["cases"]))}


def table_model(tables):
    """The model of a world given as tables; a state's number is its embedding."""

    def roots(states):
        embedding = torch.as_tensor(np.asarray(states))[:, None]
        return Root(tables["prior_logits"][states], tables["value"][states], embedding)

    def recurrent_fn(embedding, action):
        state = embedding[:, 0].numpy()
        following = roots(tables["next_state"][state, action])
        reward, discount = tables["reward"][state, action], tables["discount"][state, action]
        return Evaluation(reward, discount, following.prior_logits, following.value), following.embedding

    return roots, recurrent_fn


def golden_arrays(prefix):
    return {name.removeprefix(prefix): GOLDEN[name] for name in GOLDEN.files if name.startswith(prefix)}


@pytest.mark.parametrize("name", CASES)
def test_search_of_a_random_problem_equals_mctx(name):
    case, arrays = CASES[name], golden_arrays(f"{name}/")
    roots, recurrent_fn = table_model(golden_arrays(f"problem/{case['problem']}/"))
    root = roots(arrays["states"])
    result = gumbel_muzero_policy(root, recurrent_fn, case["sims"], arrays["gumbel"], **case["options"])
    np.testing.assert_array_equal(result.visit_counts, arrays["visit_counts"])
    np.testing.assert_array_equal(result.action, arrays["action"])
    for key in ("value", "qvalues", "action_weights"):
        np.testing.assert_allclose(getattr(result, key), arrays[key], rtol=1e-5, atol=1e-5, err_msg=key)


def three_nodes():
    """A world of a root (state 0), what it leads to by action 0 (state 1), and an end (state 2), two actions each."""
    return {
        "next_state": np.array([[1, 2], [2, 2], [2, 2]]),
        "reward": np.array([[-1, -1], [-1, -2], [-50, -50]], np.float32),
        "discount": np.array([[1, 0], [0, 0], [1, 1]], np.float32),
        "prior_logits": np.log(np.array([[0.8, 0.2], [0.3, 0.7], [0.5, 0.5]], np.float32)),
        "value": np.array([-3, -1, -50], np.float32),
    }


def test_search_of_three_nodes_by_hand():
    roots, recurrent_fn = table_model(three_nodes())
    options = {"value_scale": 0.5, "maxvisit_init": 1.0}  # logits + (1 + 1) * 0.5 * q
    result = gumbel_muzero_policy(roots([0]), recurrent_fn, 1, np.zeros((1, 2)), **options)
    # Action 0 as above; action 1 gets the mixed value (-3 + 1 * -2) / 2.
    np.testing.assert_array_equal(result.visit_counts, [[1, 0]])
    np.testing.assert_allclose(result.qvalues, [[-2, -2.5]], rtol=1e-6)
    result = gumbel_muzero_policy(roots([0]), recurrent_fn, 2, np.zeros((1, 2)), **options)
    # Both have their turn. Action 1 ends the episode at once: q = -1; the root is worth (-3 - 2 - 1) / 3.
    np.testing.assert_array_equal(result.visit_counts, [[1, 1]])
    np.testing.assert_allclose(result.qvalues, [[-2, -1]], rtol=1e-6)
    np.testing.assert_allclose(result.value, [-2], rtol=1e-6)
    # 0.8 exp(-2) against 0.2 exp(-1): log 0.8 - 2 = -2.22 is more than log 0.2 - 1 = -2.61.
    np.testing.assert_array_equal(result.action, [0])
    np.testing.assert_allclose(result.action_weights, [[0.8 / (0.8 + 0.2 * np.e), 0.2 * np.e / (0.8 + 0.2 * np.e)]])
    # Noise of 0.5 for action 1 turns the choice, and the policy to learn stays as it is.
    noisy = gumbel_muzero_policy(roots([0]), recurrent_fn, 2, np.array([[0.0, 0.5]]), **options)
    np.testing.assert_array_equal(noisy.action, [1])
    np.testing.assert_array_equal(noisy.action_weights, result.action_weights)


def test_search_of_a_batch_equals_that_of_each_root_alone():
    roots, recurrent_fn = table_model(golden_arrays("problem/steps/"))
    states, gumbel = np.arange(20), np.random.default_rng(0).gumbel(size=(20, 6))
    together = gumbel_muzero_policy(roots(states), recurrent_fn, 16, gumbel)
    for row in range(20):
        alone = gumbel_muzero_policy(roots(states[row : row + 1]), recurrent_fn, 16, gumbel[row : row + 1])
        for field, other in zip(together, alone, strict=True):
            np.testing.assert_array_equal(field[row : row + 1], other)


def test_search_without_simulations_acts_by_the_prior_and_noise():
    tables = golden_arrays("problem/steps/")
    roots, _ = table_model(tables)
    states = np.arange(20)
    prior = np.exp(tables["prior_logits"][states])
    prior /= prior.sum(axis=1, keepdims=True)
    noise = np.random.default_rng(0).gumbel(size=(20, 6))
    result = gumbel_muzero_policy(roots(states), None, 0, noise)
    np.testing.assert_array_equal(result.action, np.argmax(np.log(prior) + noise, axis=1))
    np.testing.assert_allclose(result.action_weights, prior, rtol=1e-5)
    np.testing.assert_array_equal(result.visit_counts, 0)
    np.testing.assert_array_equal(result.value, tables["value"][states])
    np.testing.assert_array_equal(result.qvalues, np.repeat(tables["value"][states, None], 6, axis=1))


def test_considered_visits_by_hand():
    # 4 actions in 2 phases of 4 simulations: each once, then the better two twice more.
    assert considered_visits(4, 8) == [0, 0, 0, 0, 1, 1, 2, 2]
    # 6 actions in 3 phases: each once; three of them once more; then the last two, as long as simulations last.
    assert considered_visits(6, 16) == [0] * 6 + [1] * 3 + [2, 2, 3, 3] + [4, 4, 5]
    assert considered_visits(1, 3) == [0, 1, 2]
    assert considered_visits(6, 4) == [0] * 4
