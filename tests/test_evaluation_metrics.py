"""SPL and intervals by hand, against published values and against scipy."""

from __future__ import annotations

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies
from scipy import stats

from mazebench.evaluation.metrics import bootstrap_interval, spl, success_interval, summarize, wilson_interval


def record(distance=1, maze="m", success=True, spl=1.0, spl_grid=1.0):
    return {"distance": distance, "maze": maze, "success": success, "spl": spl, "spl_grid": spl_grid}


class TestSpl:
    @pytest.mark.parametrize(
        ("success", "shortest", "driven", "expected"),
        [
            (True, 2.5, 2.8, 2.5 / 2.8),  # the worked example of docs/metrics.md
            (True, 3.0, 2.8, 1.0),  # driven less than l, as spl_grid allows
            (True, 2.0, 4.0, 0.5),
            (True, 2.0, 2.0, 1.0),
            (False, 2.0, 2.0, 0.0),
            (False, 2.0, 0.0, 0.0),
            (True, 0.0, 0.0, 1.0),
            (False, 0.0, 0.0, 0.0),
            (True, 2.0, 0.0, 1.0),
        ],
    )
    def test_spl_when_worked_by_hand(self, success, shortest, driven, expected):
        found = spl(np.array([success]), np.array([shortest]), np.array([driven]))
        assert found == pytest.approx([expected], abs=1e-15)

    def test_spl_when_shortest_is_0_and_the_agent_drove(self):
        # Nothing was to be driven: it scores its success.
        np.testing.assert_array_equal(spl(np.array([True, False]), np.zeros(2), np.array([1.0, 1.0])), [1, 0])

    @hypothesis.settings(max_examples=100, deadline=None)
    @hypothesis.given(strategies.booleans(), *[strategies.floats(0, 1e6)] * 2)
    def test_spl_when_lengths_are_arbitrary(self, success, shortest, driven):
        found = spl(np.array([success]), np.array([shortest]), np.array([driven]))[0]
        assert 0 <= found <= success


class TestWilson:
    @pytest.mark.parametrize(
        ("successes", "trials", "expected"),
        [
            # Newcombe 1998 (Statistics in Medicine 17, 857-872), table I, method 3: score without correction.
            (81, 263, (0.2553, 0.3662)),
            (15, 148, (0.0624, 0.1605)),
            (0, 20, (0.0000, 0.1611)),
            (1, 29, (0.0061, 0.1718)),
        ],
    )
    def test_interval_when_published(self, successes, trials, expected):
        assert wilson_interval(successes, trials) == pytest.approx(expected, abs=5e-5)

    def test_interval_when_worked_by_hand(self):
        z = stats.norm.ppf(0.975)
        # All of n succeeded: the upper end is 1, the lower n / (n + z^2).
        assert wilson_interval(1500, 1500) == pytest.approx((1500 / (1500 + z**2), 1.0), abs=1e-12)
        assert wilson_interval(0, 10) == pytest.approx((0.0, z**2 / (10 + z**2)), abs=1e-12)
        # 8 of 10: centre (p + z^2 / 2n) / (1 + z^2 / n), half width z sqrt(p q / n + z^2 / 4 n^2) / (1 + z^2 / n).
        half = z * np.sqrt(0.016 + z**2 / 400)
        expected = np.array([0.8 + z**2 / 20 - half, 0.8 + z**2 / 20 + half]) / (1 + z**2 / 10)
        assert wilson_interval(8, 10) == pytest.approx(expected, abs=1e-12)

    @pytest.mark.parametrize("confidence", [0.5, 0.95, 0.99])
    def test_interval_when_compared_with_scipy(self, confidence):
        for trials in (1, 7, 100):
            for successes in range(trials + 1):
                expected = stats.binomtest(successes, trials).proportion_ci(confidence, method="wilson")
                assert wilson_interval(successes, trials, confidence) == pytest.approx(tuple(expected))


class TestBootstrap:
    def test_interval_when_computed_twice(self):
        values = np.random.default_rng(0).random(40)
        clusters = np.arange(40) % 8
        assert bootstrap_interval(values, clusters) == bootstrap_interval(values, clusters)

    def test_interval_when_clusters_are_named_or_reordered(self):
        values, clusters = np.random.default_rng(0).random(40), np.arange(40) % 8
        expected = bootstrap_interval(values, clusters)
        names = np.array([f"13-eval-{cluster:02d}" for cluster in clusters])
        order = np.random.default_rng(1).permutation(40)
        assert bootstrap_interval(values, names) == expected
        assert bootstrap_interval(values[order], clusters[order]) == pytest.approx(expected, abs=1e-12)

    def test_interval_when_compared_with_normal_approximation(self):
        rng = np.random.default_rng(0)
        cluster_means = rng.normal(0.5, 0.1, size=400)
        values = cluster_means.repeat(5) + rng.normal(0, 0.05, size=2000)
        means = values.reshape(400, 5).mean(axis=1)
        half = 1.96 * means.std(ddof=1) / np.sqrt(400)
        low, high = bootstrap_interval(values, np.arange(400).repeat(5))
        assert (low, high) == pytest.approx((means.mean() - half, means.mean() + half), abs=0.15 * half)
        # As if independent, the 2000 values would give an interval less than half as wide.
        assert high - low > 1.8 * 2 * 1.96 * values.std() / np.sqrt(2000)

    def test_interval_when_all_of_a_cluster_are_alike(self):
        # Two mazes, one all 0 and one all 1: a quarter of the resamples are all 0, a quarter all 1.
        assert bootstrap_interval(np.array([0.0] * 10 + [1.0] * 10), np.arange(20) // 10) == (0.0, 1.0)
        # Drawn one by one they would lie near a half.
        low, high = bootstrap_interval(np.array([0.0] * 10 + [1.0] * 10), np.arange(20))
        assert 0.2 < low < 0.4 < 0.6 < high < 0.8

    def test_interval_when_clusters_differ_in_size(self):
        # Mean of the episodes, not of the mazes' means: one maze with 99 ones and one with a single 0.
        low, high = bootstrap_interval(np.array([1.0] * 99 + [0.0]), np.array([0] * 99 + [1]))
        assert (low, high) == (0.0, 1.0)
        values, clusters = np.array([1.0] * 8 + [0.0] * 2), np.array([0] * 8 + [1] * 2)
        assert bootstrap_interval(values, clusters, confidence=0.2) == (0.8, 0.8)

    def test_interval_when_there_is_one_cluster(self):
        values = np.random.default_rng(0).random(400)
        expected = bootstrap_interval(values, np.arange(400))
        assert bootstrap_interval(values, np.zeros(400)) == expected
        assert expected[0] < values.mean() < expected[1]

    def test_interval_when_there_is_one_episode(self):
        assert bootstrap_interval(np.array([0.25]), np.array(["m"])) == (0.25, 0.25)

    @hypothesis.settings(max_examples=50, deadline=None)
    @hypothesis.given(strategies.integers(5, 20), strategies.integers(1, 5), strategies.integers(0, 2**32 - 1))
    def test_interval_when_values_are_arbitrary(self, num_clusters, per_cluster, seed):
        values = np.random.default_rng(seed).random(num_clusters * per_cluster)
        low, high = bootstrap_interval(values, np.arange(num_clusters).repeat(per_cluster))
        assert values.min() - 1e-12 <= low <= values.mean() <= high <= values.max() + 1e-12


class TestSuccessInterval:
    @pytest.mark.parametrize("outcome", [True, False])
    def test_interval_when_all_ended_alike(self, outcome):
        found = success_interval(np.full(30, outcome), np.arange(30) % 3)
        assert found == wilson_interval(30 * outcome, 30)

    def test_interval_when_outcomes_differ(self):
        success = np.arange(30) % 4 == 0
        found = success_interval(success, np.arange(30) % 3)
        assert found == bootstrap_interval(success.astype(float), np.arange(30) % 3)


def test_summary_when_worked_by_hand():
    records = [
        record(10, "a", True, 0.5, 1.0),
        record(2, "a", True, 0.8, 1.0),
        record(2, "b", False, 0.0, 0.0),
        record(2, "b", True, 0.6, 0.7),
    ]
    summary = summarize(records)
    assert list(summary) == ["overall", "by_distance"]
    assert list(summary["by_distance"]) == ["2", "10"]  # by number, not by text
    keys = ["n", "success_rate", "success_rate_ci95", "spl", "spl_ci95", "spl_grid", "spl_grid_ci95"]
    for row in (summary["overall"], *summary["by_distance"].values()):
        assert sorted(row) == sorted(keys)
        for key in ("success_rate", "spl", "spl_grid"):
            low, high = row[f"{key}_ci95"]
            assert 0 <= low <= row[key] <= high <= 1
    assert summary["overall"]["n"] == 4
    assert summary["overall"]["success_rate"] == 0.75
    assert summary["overall"]["spl"] == pytest.approx(1.9 / 4)
    assert summary["overall"]["spl_grid"] == pytest.approx(2.7 / 4)
    two = summary["by_distance"]["2"]
    assert (two["n"], two["success_rate"]) == (3, pytest.approx(2 / 3))
    assert two["spl"] == pytest.approx(1.4 / 3)
    assert summary["by_distance"]["10"]["success_rate_ci95"] == list(wilson_interval(1, 1))
