"""Priorities and sampling in proportion to them."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from mazebench_agents.common.sum_tree import SumTree


def test_priorities_are_those_that_were_set_last():
    tree = SumTree(5)
    tree.set(np.array([0, 1, 4]), np.array([1.0, 2.0, 3.0]))
    tree.set(np.array([1]), np.array([0.5]))
    np.testing.assert_array_equal(tree.priorities(np.arange(5)), [1.0, 0.5, 0.0, 0.0, 3.0])


def test_sample_frequencies_follow_priorities():
    tree = SumTree(3)
    tree.set(np.arange(3), np.array([1.0, 0.0, 3.0]))
    items = tree.sample(4000, np.random.default_rng(0))
    counts = np.bincount(items, minlength=3)
    assert counts[1] == 0
    assert abs(counts[0] - 1000) <= 1  # stratified: off by one at most
    assert abs(counts[2] - 3000) <= 1


@given(st.lists(st.floats(0, 10), min_size=1, max_size=40), st.integers(0, 2**32 - 1))
def test_sample_never_finds_an_item_without_priority(priorities, seed):
    values = np.array([*priorities, 1.0])
    tree = SumTree(len(values))
    tree.set(np.arange(len(values)), values)
    assert (values[tree.sample(16, np.random.default_rng(seed))] > 0).all()
