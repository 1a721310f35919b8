"""Tree search: against mctx's answers, by hand, and on small worlds where the best action is known."""

import json
import pathlib

import numpy as np
import pytest
import torch
from mazebench_agents.muzero import search
from processes import run_python

torch.set_num_threads(1)  # two that share a core with other tests wait for each other

GOLDEN = np.load(pathlib.Path(__file__).parent / "golden" / "search.npz")
CASES = {case["name"]: case for case in json.loads(str(GOLDEN["cases"]))}


def table_model(tables):
    """The model of a world given as tables; a state's number is its embedding."""

    def roots(states):
        embedding = torch.as_tensor(np.asarray(states))[:, None]
        return search.Root(tables["prior_logits"][states], tables["value"][states], embedding)

    def recurrent_fn(embedding, action):
        state = embedding[:, 0].numpy()
        following = roots(tables["next_state"][state, action])
        reward, discount = tables["reward"][state, action], tables["discount"][state, action]
        return search.Evaluation(reward, discount, following.prior_logits, following.value), following.embedding

    return roots, recurrent_fn


def golden_arrays(prefix):
    return {name.removeprefix(prefix): GOLDEN[name] for name in GOLDEN.files if name.startswith(prefix)}


@pytest.mark.parametrize("name", CASES)
def test_search_of_a_random_problem_equals_mctx(name):
    case, arrays = CASES[name], golden_arrays(f"{name}/")
    roots, recurrent_fn = table_model(golden_arrays(f"problem/{case['problem']}/"))
    noise = {key: arrays[key] for key in ("gumbel", "dirichlet_noise", "action_noise") if key in arrays}
    policy = getattr(search, case["policy"])
    result = policy(roots(arrays["states"]), recurrent_fn, case["sims"], **noise, **case["options"])
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


def test_puct_of_three_nodes_by_hand():
    roots, recurrent_fn = table_model(three_nodes())
    noise = np.array([[0.5, 0.5]])
    result = search.muzero_policy(roots([0]), recurrent_fn, 2, noise, np.zeros((1, 2)), dirichlet_fraction=0.0)
    # 1: without visits the prior decides: action 0, q = -1 + 1 * -1 = -2, and the root's value (-3 - 2) / 2 = -2.5.
    # 2: q is the best so far and becomes 1, plus 1.25 sqrt(2) 0.8 / 2 = 0.71, against 1.25 sqrt(2) 0.2 = 0.35 of
    # action 1. In state 1 the prior decides for action 1, which costs 2 and ends: its -50 doesn't count. State 1 is
    # now worth (-1 - 2) / 2 = -1.5, so q = -2.5; the root got -1 - 2 = -3 and is worth (-3 - 2 - 3) / 3.
    np.testing.assert_array_equal(result.visit_counts, [[2, 0]])
    np.testing.assert_array_equal(result.action, [0])
    np.testing.assert_allclose(result.action_weights, [[1, 0]])
    np.testing.assert_allclose(result.value, [-8 / 3], rtol=1e-6)
    np.testing.assert_allclose(result.qvalues, [[-2.5, -8 / 3]], rtol=1e-6)  # the other one the least that was seen


def test_gumbel_of_three_nodes_by_hand():
    roots, recurrent_fn = table_model(three_nodes())
    options = {"value_scale": 0.5, "maxvisit_init": 1.0, "rescale_values": False}  # logits + (1 + 1) * 0.5 * q
    result = search.gumbel_muzero_policy(roots([0]), recurrent_fn, 1, np.zeros((1, 2)), **options)
    # Action 0 as above; action 1 gets the mixed value (-3 + 1 * -2) / 2.
    np.testing.assert_array_equal(result.visit_counts, [[1, 0]])
    np.testing.assert_allclose(result.qvalues, [[-2, -2.5]], rtol=1e-6)
    result = search.gumbel_muzero_policy(roots([0]), recurrent_fn, 2, np.zeros((1, 2)), **options)
    # Both have their turn. Action 1 ends the episode at once: q = -1; the root is worth (-3 - 2 - 1) / 3.
    np.testing.assert_array_equal(result.visit_counts, [[1, 1]])
    np.testing.assert_allclose(result.qvalues, [[-2, -1]], rtol=1e-6)
    np.testing.assert_allclose(result.value, [-2], rtol=1e-6)
    # 0.8 exp(-2) against 0.2 exp(-1): log 0.8 - 2 = -2.22 is more than log 0.2 - 1 = -2.61.
    np.testing.assert_array_equal(result.action, [0])
    np.testing.assert_allclose(result.action_weights, [[0.8 / (0.8 + 0.2 * np.e), 0.2 * np.e / (0.8 + 0.2 * np.e)]])
    # Noise of 0.5 for action 1 turns the choice, and the policy to learn stays as it is.
    noisy = search.gumbel_muzero_policy(roots([0]), recurrent_fn, 2, np.array([[0.0, 0.5]]), **options)
    np.testing.assert_array_equal(noisy.action, [1])
    np.testing.assert_array_equal(noisy.action_weights, result.action_weights)


MAZE = """
#########
#...#...#
#.#.#.#.#
#.#...#G#
#########
"""


def maze_tables(informed):
    """The exact model of a maze: north, south, west, east and two ways to stay; -1 a step until G.

    What would follow the goal is worth -50. The values are the true ones; `informed` tells the policy as well.
    """
    grid = np.array([list(row) for row in MAZE.split()])
    cells = [tuple(cell) for cell in np.argwhere(grid != "#")]
    goal = next(index for index, cell in enumerate(cells) if grid[cell] == "G")
    moves = [(-1, 0), (1, 0), (0, -1), (0, 1), (0, 0), (0, 0)]
    next_state = np.array([[index_after(cells, cell, move) for move in moves] for cell in cells])
    steps = np.full(len(cells), 99.0)
    steps[goal] = 0
    for _ in cells:
        steps = np.minimum(steps, 1 + steps[next_state].min(axis=1))
    best = steps[next_state] == steps[next_state].min(axis=1, keepdims=True)
    tables = {
        "next_state": next_state,
        "reward": np.full(next_state.shape, -1, np.float32),
        "discount": (next_state != goal).astype(np.float32),
        "prior_logits": np.where(best & informed, 10, 0).astype(np.float32),
        "value": np.where(steps == 0, -50, -steps).astype(np.float32),
    }
    return tables, steps, best


def index_after(cells, cell, move):
    moved = (cell[0] + move[0], cell[1] + move[1])
    return cells.index(moved if moved in cells else cell)


def search_both(tables, states, num_simulations):
    roots, recurrent_fn = table_model(tables)
    zeros = np.zeros((len(states), tables["reward"].shape[1]))
    options = {"value_scale": 0.03, "rescale_values": False}  # logits of 1.5 and more a step
    yield search.gumbel_muzero_policy(roots(states), recurrent_fn, num_simulations, zeros, **options)
    yield search.muzero_policy(roots(states), recurrent_fn, num_simulations, zeros, zeros, dirichlet_fraction=0.0)


@pytest.mark.parametrize("num_simulations", [16, 64])
def test_search_of_a_maze_with_its_exact_model_takes_a_shortest_path(num_simulations):
    tables, steps, best = maze_tables(informed=False)
    states = np.flatnonzero(steps > 0)
    for result in search_both(tables, states, num_simulations):
        assert best[states, result.action].all()


def test_search_of_a_maze_with_its_exact_model_and_policy_finds_the_exact_values():
    tables, steps, _ = maze_tables(informed=True)
    states = np.flatnonzero(steps > 0)
    gumbel, puct = search_both(tables, states, 32)
    # Every path goes on by shortest ways, and none of them through the goal.
    assert (gumbel.visit_counts > 0).all()
    np.testing.assert_allclose(gumbel.qvalues, -1 - steps[tables["next_state"][states]], rtol=1e-6)
    np.testing.assert_allclose(puct.value, -steps[states], rtol=1e-6)
    assert steps.max() == 14


def test_search_of_a_goal_that_is_next_never_looks_behind_it():
    tables, steps, _ = maze_tables(informed=True)
    states = np.flatnonzero(steps == 1)
    for result in search_both(tables, states, 32):
        # The tree goes on below the goal, where each step would cost another 1 and end at -50.
        assert result.visit_counts[0, 1] > 1
        np.testing.assert_array_equal(result.qvalues[0, 1], -1)


def random_searches(states, order=slice(None), num_simulations=16):
    """Both policies' results from some states of a stored problem, with noise that belongs to the state."""
    roots, recurrent_fn = table_model(golden_arrays("problem/steps/"))
    rngs = [np.random.default_rng(state) for state in states]
    gumbel = np.array([rng.gumbel(size=6) for rng in rngs])[order]
    dirichlet = np.array([rng.dirichlet(np.full(6, 0.3)) for rng in rngs])[order]
    root = roots(states[order])
    return [
        search.gumbel_muzero_policy(root, recurrent_fn, num_simulations, gumbel, rescale_values=False),
        search.muzero_policy(root, recurrent_fn, num_simulations, dirichlet, gumbel),
    ]


def test_search_of_a_batch_equals_that_of_each_root_alone():
    states = np.arange(20)
    together = random_searches(states)
    for row in range(20):
        for result, alone in zip(together, random_searches(states[row : row + 1]), strict=True):
            for field, other in zip(result, alone, strict=True):
                np.testing.assert_array_equal(field[row : row + 1], other)


def test_search_without_simulations_acts_by_the_prior_and_noise():
    tables = golden_arrays("problem/steps/")
    roots, _ = table_model(tables)
    states = np.arange(20)
    prior = np.exp(tables["prior_logits"][states])
    prior /= prior.sum(axis=1, keepdims=True)
    noise = np.random.default_rng(0).gumbel(size=(20, 6))
    zeros = np.zeros((20, 6))
    for result in (
        search.gumbel_muzero_policy(roots(states), None, 0, noise),
        search.muzero_policy(roots(states), None, 0, zeros, noise, dirichlet_fraction=0.0),
    ):
        np.testing.assert_array_equal(result.action, np.argmax(np.log(prior) + noise, axis=1))
        np.testing.assert_allclose(result.action_weights, prior, rtol=1e-5)
        np.testing.assert_array_equal(result.visit_counts, 0)
        np.testing.assert_array_equal(result.value, tables["value"][states])
        np.testing.assert_array_equal(result.qvalues, np.repeat(tables["value"][states, None], 6, axis=1))


def test_considered_visits_by_hand():
    # 4 actions in 2 phases of 4 simulations: each once, then the better two twice more.
    assert search.considered_visits(4, 8) == [0, 0, 0, 0, 1, 1, 2, 2]
    # 6 actions in 3 phases: each once; three of them once more; then the last two, as long as simulations last.
    assert search.considered_visits(6, 16) == [0] * 6 + [1] * 3 + [2, 2, 3, 3] + [4, 4, 5]
    assert search.considered_visits(1, 3) == [0, 1, 2]
    assert search.considered_visits(6, 4) == [0] * 4


@pytest.mark.slow
def test_speed_of_the_search_is_measured_beside_that_of_mctx():
    script = pathlib.Path(__file__).parent.parent / "benchmarks" / "search.py"
    said = run_python(script, "--seconds", "0.01").stdout
    rows = [line.split(" | ") for line in said.splitlines() if "," in line and line.startswith("| ")][1:]
    assert [row[0] for row in rows] == ["| gumbel, 1", "| gumbel, 64", "| gumbel, 256", "| puct, 64"]
    assert all(float(row[1].replace(",", "")) > 0 for row in rows)
