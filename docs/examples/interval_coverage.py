"""Shares of simulated evaluations whose 95 % intervals hold the true mean: the numbers of docs/intervals.md.

python interval_coverage.py [NUMBER]      of evaluations in each cell of the tables, 2,000 by default
"""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np
from scipy import special

from mazebench.results.intervals import Estimate, difference_interval, mean_interval, runs_interval

RATES = (0.02, 0.1, 0.5, 0.8, 0.9, 0.95, 0.98, 0.99, 1.0)
RATES_OF_RUNS = (0.1, 0.3, 0.5, 0.8, 0.95)
DEVIATION = 0.7  # standard deviation of the log odds of a success over mazes, and again over episodes
LEAST_SPL = 0.7  # of a success; the mean is halfway to 1
OTHER = 0.8  # rate of the agent that is compared, as a share of the other one's in the same maze


def of_one_run(kind: str, mazes: int, size: int, correlation: float, rate: float, count: int) -> float:
    """Returns the coverage of success, SPL or a difference of success in mazes with `size` episodes each.

    Successes are beta-binomial: two episodes of a maze have the given correlation.
    """
    numbers, rng = np.arange(mazes).repeat(size), np.random.default_rng(0)

    def evaluation() -> Estimate:
        rates, strength = np.full(mazes, rate), 1 / correlation - 1 if correlation else 0.0
        if correlation and rate < 1:
            rates = rng.beta(rate * strength, (1 - rate) * strength, mazes)
        success = (rng.random(len(numbers)) < rates.repeat(size)).astype(float)
        if kind == "difference":
            return difference_interval(success - (rng.random(len(numbers)) < OTHER * rates.repeat(size)), numbers)
        return mean_interval(success * (rng.uniform(LEAST_SPL, 1, len(numbers)) if kind == "SPL" else 1), numbers)

    factors = {"success": 1.0, "SPL": (1 + LEAST_SPL) / 2, "difference": 1 - OTHER}
    return coverage(evaluation, rate * factors[kind], count)


def of_several_runs(runs: int, of_runs: float, rate: float, count: int) -> float:
    """Returns the coverage of the success of several training runs in 48 mazes with 5 episodes each.

    Log odds vary over mazes and episodes, and over runs with the standard deviation `of_runs`.
    """
    numbers, rng = np.arange(48).repeat(5), np.random.default_rng(0)

    def evaluation() -> Estimate:
        odds = special.logit(rate) + DEVIATION * (rng.standard_normal(48).repeat(5) + rng.standard_normal(240))
        odds = odds + of_runs * rng.standard_normal((runs, 1))
        return runs_interval((rng.random(odds.shape) < special.expit(odds)).astype(float), numbers)

    # The mean over all runs, mazes and episodes, by quadrature.
    deviates, weights = np.polynomial.hermite_e.hermegauss(60)
    odds = special.logit(rate) + np.sqrt(2 * DEVIATION**2 + of_runs**2) * deviates
    return coverage(evaluation, float(weights @ special.expit(odds) / weights.sum()), count)


def coverage(evaluation: Callable[[], Estimate], truth: float, count: int) -> float:
    """Returns the share of `count` evaluations whose interval holds the truth, but for rounding."""
    estimates = [evaluation() for _ in range(count)]
    return float(np.mean([each.low - 1e-12 <= truth <= each.high + 1e-12 for each in estimates]))


def print_row(*cells: object) -> None:
    """Prints a row of a table in Markdown."""
    print(f"| {' | '.join(map(str, cells))} |", flush=True)


if __name__ == "__main__":
    count = int(sys.argv[1]) if sys.argv[1:] else 2_000
    designs = ((48, 5), (20, 5), (20, 75), (27, 12), (12, 12))
    sizes = [(mazes, size, by) for mazes, size in designs for by in (0.0, 0.05, 0.2)]
    print_row("of", "mazes x episodes", "correlation", *RATES)
    for kind in ("success", "SPL", "difference"):
        for mazes, size, by in [*sizes, (20, 1, 0.0)]:
            cells = [f"{of_one_run(kind, mazes, size, by, rate, count):.2f}" for rate in RATES]
            print_row(kind, f"{mazes} x {size}", f"{by:g}", *cells)
    print_row("runs", "deviation of runs", *RATES_OF_RUNS)
    for runs in (3, 5):
        for of_runs in (0.0, 0.3, 0.6, 1.0):
            print_row(runs, of_runs, *(f"{of_several_runs(runs, of_runs, rate, count):.2f}" for rate in RATES_OF_RUNS))
