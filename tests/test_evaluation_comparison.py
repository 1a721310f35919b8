"""Comparisons: numbers done by hand, and intervals held against scipy's bootstrap."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from mazebench.errors import InputError
from mazebench.evaluation.comparison import (
    compare_results,
    interquartile_mean,
    paired_difference,
    pool_runs,
    probability_of_improvement,
    stratified_bootstrap_interval,
    success_difference,
)
from mazebench.evaluation.metrics import wilson_interval
from mazebench.evaluation.results import Result

MAZES = np.array(["a", "a", "b", "b"])


def record(index: int, maze: str, distance: int, success: bool, spl: float) -> dict:
    place = {"maze": maze, "start": [1, 1], "goal": [1, 1 + distance], "distance": distance, "seed": index}
    return {"episode": index, **place, "success": success, "spl": spl, "spl_grid": min(1.0, 1.2 * spl)}


def result(folder, records: list[dict], **changes) -> Result:
    provenance = {"benchmark_manifest_sha256": changes.pop("manifest", "0f"), "mazes_sha256": "a1"}
    summary = {"agent": "x", "task": "local", "size": 13, "split": "eval", "benchmark": "v1", "perturbation": {}}
    return Result(folder, {**summary, "provenance": provenance, **changes}, records)


class TestPairedDifference:
    def test_difference_when_worked_by_hand(self):
        # Maze a: A wins both; maze b: a tie and a loss. Means of the mazes 1 and -0.5: a quarter of the resamples draw
        # a twice, a quarter b twice.
        a, b = np.array([1.0, 1.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0])
        assert paired_difference(a, b, MAZES) == (0.25, (-0.5, 1.0))
        assert success_difference(a.astype(bool), b.astype(bool), MAZES) == (0.25, (-0.5, 1.0))

    @pytest.mark.parametrize(
        ("a", "b", "expected"),
        [(True, False, "won"), (False, True, "lost"), (True, True, "tie"), (False, False, "tie")],
    )
    def test_interval_when_all_differ_alike(self, a, b, expected):
        difference, (low, high) = success_difference(np.full(20, a), np.full(20, b), np.arange(20) % 4)
        assert difference == a - b
        bound = wilson_interval(20, 20)[0]  # 20 / (20 + 1.96 ** 2) = 0.839
        assert bound == pytest.approx(0.8389, abs=1e-4)
        intervals = {"won": (bound, 1.0), "lost": (-1.0, -bound), "tie": (bound - 1, 1 - bound)}
        assert (low, high) == pytest.approx(intervals[expected])

    def test_interval_when_an_agent_is_held_against_itself(self):
        spl = np.array([0.5, 0.9, 0.0, 0.7])
        assert paired_difference(spl, spl, MAZES) == (0.0, (0.0, 0.0))

    def test_interval_when_held_against_scipy(self):
        rng = np.random.default_rng(0)
        a, b = rng.random((2, 40, 25))
        a += 0.1 * rng.normal(size=(40, 1))  # what the episodes of a maze have in common
        # Mazes of one size: the mean over episodes is that of the mazes' means.
        means = (a - b).mean(axis=1)
        expected = stats.bootstrap((means,), np.mean, n_resamples=20_000, method="percentile", rng=1)
        difference, interval = paired_difference(a.ravel(), b.ravel(), np.arange(40).repeat(25))
        assert difference == pytest.approx(means.mean())
        width = expected.confidence_interval.high - expected.confidence_interval.low
        assert interval == pytest.approx(expected.confidence_interval, abs=0.05 * width)


class TestProbabilityOfImprovement:
    def test_probability_when_worked_by_hand(self):
        # A win, a tie, a loss and a tie: (1 + 0.5 + 0 + 0.5) / 4; maze a has 0.75, b 0.25.
        a, b = np.array([0.9, 0.0, 0.2, 1.0]), np.array([0.8, 0.0, 0.3, 1.0])
        assert probability_of_improvement(a, b, MAZES) == (0.5, (0.25, 0.75))

    def test_probability_when_held_against_scipy(self):
        # Over all pairs of episodes it is Mann and Whitney's U over their number.
        a, b = np.random.default_rng(0).integers(0, 5, size=(2, 30)).astype(float)
        left, right = (values.ravel() for values in np.meshgrid(a, b))
        found, _ = probability_of_improvement(left, right, np.arange(900))
        assert found == pytest.approx(stats.mannwhitneyu(a, b).statistic / 900)

    def test_probabilities_when_sides_are_changed(self):
        a, b = np.random.default_rng(1).random((2, 60)).round(1)
        forth, _ = probability_of_improvement(a, b, np.arange(60) % 5)
        back, _ = probability_of_improvement(b, a, np.arange(60) % 5)
        assert forth + back == pytest.approx(1)


class TestRuns:
    def test_interquartile_mean_when_worked_by_hand(self):
        # Of 8 scores the two lowest and the two highest go.
        assert interquartile_mean(np.array([[0.0, 0.1, 0.4, 0.5], [0.6, 0.7, 0.9, 1.0]])) == pytest.approx(2.2 / 4)
        # Of 6 one at either end, as rliable has it: a quarter of 6, rounded down.
        assert interquartile_mean(np.array([0.0, 0.2, 0.4, 0.6, 0.8, 1.0])) == pytest.approx(0.5)

    def test_interval_when_there_is_one_task(self):
        # Then it is the ordinary bootstrap over runs.
        scores = np.random.default_rng(0).random((30, 1))
        expected = stats.bootstrap((scores[:, 0],), np.mean, n_resamples=20_000, method="percentile", rng=1)
        found = stratified_bootstrap_interval(scores, lambda values: float(values.mean()))
        width = expected.confidence_interval.high - expected.confidence_interval.low
        assert found == pytest.approx(expected.confidence_interval, abs=0.05 * width)

    def test_interval_when_tasks_differ_and_runs_do_not(self):
        # Only other runs are drawn, never other tasks.
        scores = np.array([[0.1, 0.9], [0.1, 0.9], [0.1, 0.9]])
        assert stratified_bootstrap_interval(scores, interquartile_mean) == pytest.approx((0.5, 0.5))

    def test_interval_when_strata_are_worked_by_hand(self):
        # Two runs of two tasks, each task 0 and 1: the mean of four fair draws; P(0) = 1/16, so 2.5 % lies at 0.
        scores = np.array([[0.0, 1.0], [1.0, 0.0]])
        assert stratified_bootstrap_interval(scores, lambda values: float(values.mean())) == (0.0, 1.0)
        # Were whole runs drawn, every mean would be 0.5.

    def test_pool_when_worked_by_hand(self):
        runs = [
            [record(0, "a", 2, True, 0.8), record(1, "a", 4, False, 0.0), record(2, "b", 2, True, 0.6)],
            [record(0, "a", 2, True, 0.8), record(1, "a", 4, True, 0.4), record(2, "b", 2, True, 0.6)],
        ]
        # Success by run and maze: [[0.5, 1], [1, 1]]; of four scores the middle two are 1 and 1.
        pooled = pool_runs(runs)
        assert list(pooled) == ["runs", "mean", "mean_ci95", "iqm", "iqm_ci95"]
        assert (pooled["runs"], pooled["mean"], pooled["iqm"]) == (2, 0.875, 1.0)
        # Maze a draws two of 0.5 and 1, maze b always 1.
        assert pooled["mean_ci95"] == [0.75, 1.0]
        assert pool_runs(runs, "spl")["mean"] == pytest.approx((0.4 + 0.6 + 0.6 + 0.6) / 4)

    def test_pool_when_runs_do_not_fit(self):
        runs = [[record(0, "a", 2, True, 0.8)], [record(0, "b", 2, True, 0.8)]]
        with pytest.raises(InputError, match="found in run 2 episode 0 with maze a and b"):
            pool_runs(runs)
        with pytest.raises(InputError, match="expected at least two training runs to pool, found 1"):
            pool_runs(runs[:1])


class TestResults:
    def test_comparison_when_worked_by_hand(self, tmp_path):
        ours = [record(0, "a", 2, True, 0.8), record(1, "a", 10, True, 0.5), record(2, "b", 10, False, 0.0)]
        theirs = [record(0, "a", 2, True, 0.8), record(1, "a", 10, False, 0.0), record(2, "b", 10, False, 0.0)]
        found = compare_results(result(tmp_path, ours), result(tmp_path, theirs))
        assert list(found["by_distance"]) == ["2", "10"]  # by number
        row = found["overall"]
        assert row["n"] == 3
        assert (row["success_rate_a"], row["success_rate_b"]) == pytest.approx((2 / 3, 1 / 3))
        assert row["success_rate_difference"] == pytest.approx(1 / 3)
        assert row["spl_difference"] == pytest.approx(0.5 / 3)
        assert row["spl_grid_difference"] == pytest.approx(0.6 / 3)
        assert row["probability_of_improvement"] == pytest.approx(2 / 3)
        assert row["success_rate_difference_ci95"] == pytest.approx([0.0, 0.5])  # maze b twice, maze a twice
        assert found["by_distance"]["10"]["success_rate_difference"] == 0.5

    @pytest.mark.parametrize(
        ("changes", "said"),
        [
            ({"benchmark": "v0"}, "expected results of one benchmark to compare, found v1 in .* and v0 in"),
            ({"manifest": "1e"}, "results of one benchmark_manifest_sha256 to compare, found 0f in .* and 1e in"),
            ({"task": "hierarchical"}, "results of one task to compare, found local in .* and hierarchical in"),
            ({"size": 15}, "results of one size to compare, found 13 in .* and 15 in"),
            ({"split": "train"}, "results of one split to compare, found eval in .* and train in"),
        ],
    )
    def test_comparison_when_results_do_not_pair(self, tmp_path, changes, said):
        records = [record(0, "a", 2, True, 0.8)]
        with pytest.raises(InputError, match=said):
            compare_results(result(tmp_path / "a", records), result(tmp_path / "b", records, **changes))

    def test_comparison_when_episodes_differ(self, tmp_path):
        records = [record(0, "a", 2, True, 0.8), record(1, "a", 2, True, 0.8)]
        others = [records[0], {**records[1], "seed": 7}]
        with pytest.raises(InputError, match=r"same episodes in .*, found episode 1 with seed 1 and 7$"):
            compare_results(result(tmp_path, records), result(tmp_path, others))
        with pytest.raises(InputError, match=r"found 2 and 1 of them$"):
            compare_results(result(tmp_path, records), result(tmp_path, records[:1]))
