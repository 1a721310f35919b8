"""Intervals: numbers done by hand or published, and what must hold whatever the episodes."""

from __future__ import annotations

import pathlib
import runpy

import hypothesis
import numpy as np
import pytest
import scipy.stats
from hypothesis import strategies
from scipy import stats

from mazebench.results.intervals import (
    difference_interval,
    mean_interval,
    runs_interval,
    wilson_interval,
)

Z = stats.norm.ppf(0.975)
MAZES = np.arange(100) // 5  # 20 mazes of 5 episodes


def outcomes(successes: list[int], size: int) -> tuple[np.ndarray, np.ndarray]:
    """Episodes and their mazes: `size` of each maze, of which so many succeed."""
    values = np.arange(size) < np.array(successes)[:, None]
    return values.ravel().astype(float), np.arange(len(successes)).repeat(size)


class TestWilson:
    def test_interval_agrees_with_scipy(self):
        for trials in (1, 7, 100):
            for successes in range(trials + 1):
                expected = stats.binomtest(successes, trials).proportion_ci(0.95, method="wilson")
                assert wilson_interval(successes / trials, trials) == pytest.approx(tuple(expected), abs=1e-12)


class TestMeans:
    # Of n effective episodes that all succeed the lower end is n / (n + z^2).
    @pytest.mark.parametrize(
        ("size", "effective", "low"), [(1, 20, 0.839), (5, 100 / 1.4, 0.949), (75, 1500 / 8.4, 0.979)]
    )
    def test_all_successes_use_the_default_correlation(self, size, effective, low):
        found = mean_interval(*outcomes([size] * 20, size))
        assert (found.value, found.high) == (1.0, 1.0)
        assert found.low == pytest.approx(effective / (effective + Z**2))
        assert found.low == pytest.approx(low, abs=5e-4)

    def test_mazes_of_five_and_three_successes(self):
        # Residual sums are +1 and -1 in 20 mazes: 20 x 20 / 19, and the squared ratio of the t quantiles.
        few = stats.t.ppf(0.975, 19) / stats.t.ppf(0.975, 99)
        squares = few**2 * 20 * 20 / 19
        effect = (squares + 2.8 * 1.4) / (100 * 0.8 * 0.2 + 2.8)
        assert effect == pytest.approx(1.45, abs=5e-3)
        found = mean_interval(*outcomes([5, 3] * 10, 5))
        assert (found.low, found.high) == pytest.approx(wilson_interval(0.8, 100 / effect))
        assert (found.low, found.high) == pytest.approx((0.691, 0.877), abs=6e-4)

    def test_one_episode_a_maze_is_plain_wilson(self):
        success = (np.arange(20) < 17).astype(float)
        found = mean_interval(success, np.arange(20))
        assert (found.low, found.high) == pytest.approx(wilson_interval(0.85, 20))

    @hypothesis.settings(max_examples=100, deadline=None)
    @hypothesis.given(
        strategies.lists(strategies.tuples(strategies.integers(0, 3), strategies.floats(0, 1)), min_size=1, max_size=60)
    )
    def test_interval_contains_the_mean_and_mirrors(self, episodes):
        mazes, values = (np.array(column) for column in zip(*episodes, strict=True))
        found, mirrored = mean_interval(values, mazes), mean_interval(1 - values, mazes)
        assert 0 <= found.low <= found.value <= found.high <= 1
        assert found.high - found.low > 0
        assert (found.low, found.high) == pytest.approx((1 - mirrored.high, 1 - mirrored.low), abs=1e-9)


class TestMonotone:
    @pytest.mark.parametrize("scattered", [True, False])
    @pytest.mark.parametrize("size", [5, 75])
    def test_failures_lower_both_bounds_from_the_first_on(self, size, scattered):
        intervals = []
        for failures in range(min(10, size) + 1):
            successes = np.full(20, size)
            if scattered:
                successes[:failures] -= 1
            else:
                successes[0] -= failures
            intervals.append(mean_interval(*outcomes(successes, size)))
        assert (np.diff([interval.low for interval in intervals]) < 0).all()
        assert (np.diff([interval.high for interval in intervals]) < 0).all()


class TestDifferences:
    def test_ties_alone_give_an_interval_about_0(self):
        # One episode a maze, Bonett and Price: two pairs more, one won and one lost.
        found = difference_interval(np.zeros(20), np.arange(20))
        half_width = Z * np.sqrt(2) / 22
        assert (found.value, found.low, found.high) == pytest.approx((0, -half_width, half_width))
        assert half_width == pytest.approx(0.126, abs=5e-4)
        # Five episodes a maze: each of the two counts for 1.4.
        assert difference_interval(np.zeros(100), MAZES).high == pytest.approx(1.4 * Z * np.sqrt(2) / 102.8)

    def test_wins_and_losses_agree_with_the_bootstrap_of_scipy(self):
        differences = np.array([1.0] * 8 + [-1.0] * 2 + [0.0] * 20)
        expected = scipy.stats.bootstrap((differences,), np.mean, method="percentile", rng=np.random.default_rng(1))
        wider = np.sqrt(30 / 29) * scipy.stats.t.ppf(0.975, 29) / Z
        found = difference_interval(differences, np.arange(30))
        assert found.value == pytest.approx(0.2)
        ends = [0.2 + wider * (end - 0.2) for end in expected.confidence_interval]
        assert (found.low, found.high) == pytest.approx(ends, abs=0.04)  # a step is 1 / 30
        assert difference_interval(differences, np.zeros(30)) == found  # a single maze

    def test_a_few_losses_in_many_ties_are_told_from_none(self):
        # Six mazes of 48 with a loss each: no draw of mazes has a gain, and hardly one has no loss.
        differences = np.zeros(240)
        differences[:30:5] = -1
        found = difference_interval(differences, np.repeat(np.arange(48), 5))
        assert -0.05 < found.low < found.value < found.high < 0

    def test_the_same_differences_give_the_same_interval(self):
        differences = np.random.default_rng(0).choice([-1.0, 0.0, 1.0], 100)
        assert difference_interval(differences, MAZES) == difference_interval(differences, MAZES)

    def test_mazes_that_decide_together_widen_the_interval(self):
        alone = np.tile([1.0, -1.0, 0.0, 0.0, 0.0], 20)
        together = np.repeat([1.0, -1.0, 0.0, 0.0, 0.0], 20)
        assert difference_interval(together, MAZES).high > 1.5 * difference_interval(alone, MAZES).high

    @hypothesis.settings(max_examples=100, deadline=None)
    @hypothesis.given(
        strategies.lists(
            strategies.tuples(strategies.integers(0, 3), strategies.floats(-1, 1)), min_size=1, max_size=60
        )
    )
    def test_interval_contains_the_difference_and_mirrors(self, episodes):
        mazes, values = (np.array(column) for column in zip(*episodes, strict=True))
        found, mirrored = difference_interval(values, mazes), difference_interval(-values, mazes)
        assert -1 <= found.low <= found.value <= found.high <= 1
        assert found.high - found.low > 0
        assert (found.low, found.high) == pytest.approx((-mirrored.high, -mirrored.low), abs=1e-9)


class TestRunsAndMazes:
    RUNS = np.array([outcomes([2, 3, 1, 4], 4)[0], outcomes([3, 4, 1, 4], 4)[0], outcomes([4, 4, 4, 4], 4)[0]])
    MAZES = np.arange(4).repeat(4)

    def test_half_widths_over_runs_and_mazes_add_as_squares(self):
        means = np.array([10, 12, 16]) / 16
        student = stats.t.ppf(0.975, 2) * stats.sem(means)
        over_mazes = mean_interval(self.RUNS.mean(axis=0), self.MAZES)
        found = runs_interval(self.RUNS, self.MAZES)
        assert (found.value, found.low) == pytest.approx((0.79, 0.22), abs=5e-3)
        assert found.low == pytest.approx(found.value - np.hypot(student, over_mazes.value - over_mazes.low))
        assert found.high == 1

    def test_equal_runs_have_the_interval_over_mazes(self):
        assert runs_interval(self.RUNS[[0, 0]], self.MAZES) == mean_interval(self.RUNS[0], self.MAZES)
        none = np.zeros_like(self.RUNS)
        expected = difference_interval(self.RUNS[0], self.MAZES)
        assert runs_interval(self.RUNS[[0, 0]], self.MAZES, none) == expected

    def test_a_difference_has_the_degrees_of_freedom_of_welch(self):
        others = np.array([outcomes([1, 0, 1, 1], 4)[0], outcomes([1, 2, 1, 3], 4)[0]])
        over_mazes = difference_interval(self.RUNS.mean(axis=0) - others.mean(axis=0), self.MAZES)
        welch = stats.ttest_ind(self.RUNS.mean(axis=1), others.mean(axis=1), equal_var=False)
        low = welch.confidence_interval(0.95).low
        found = runs_interval(self.RUNS, self.MAZES, others)
        expected = np.hypot(found.value - low, found.value - over_mazes.low)
        assert found.value - found.low == pytest.approx(expected)
        assert found.high == 1

    def test_an_agent_that_is_not_trained_has_one_run(self):
        constant = np.full((1, 16), 0.5)
        alone = runs_interval(self.RUNS, self.MAZES)
        found = runs_interval(self.RUNS, self.MAZES, constant)
        assert found.value == pytest.approx(alone.value - 0.5)
        assert runs_interval(constant, self.MAZES) == mean_interval(constant[0], self.MAZES)


@pytest.mark.slow
def test_two_cells_of_the_published_simulation_of_coverage():
    found = runpy.run_path(str(pathlib.Path(__file__).parent.parent / "docs" / "examples" / "interval_coverage.py"))
    assert f"{found['of_one_run']('success', 48, 5, 0.2, 0.9, 2_000):.2f}" == "0.95"
    assert f"{found['of_several_runs'](3, 1.0, 0.95, 2_000):.2f}" == "0.92"
