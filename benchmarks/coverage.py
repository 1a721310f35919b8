"""Coverage of the 95 % intervals in simulated evaluations, whose tables are in docs/intervals.md.

python -m benchmarks.coverage [NUMBER]     of simulated evaluations of each kind, 2,000 by default
"""

from __future__ import annotations

import itertools
import sys
from collections.abc import Iterable

import numpy as np
from scipy import special

from benchmarks.results.results_tables import format_table
from mazebench.results.intervals import Estimate, mean_interval, runs_interval

_RATES = (0.02, 0.1, 0.5, 0.8, 0.9, 0.95, 0.98, 0.99, 1.0)
_RATES_OF_RUNS = (0.1, 0.3, 0.5, 0.8, 0.95)
_OF_MAZES, _OF_EPISODES = 0.7, 0.7  # standard deviations of log odds


def beta_binomial(rng: np.random.Generator, rate: float, correlation: float, mazes: int, size: int) -> np.ndarray:
    """Returns successes `[E]` in mazes with `size` episodes each, two of which have the given correlation."""
    rates = np.full(mazes, rate)
    if correlation and rate < 1:
        strength = 1 / correlation - 1
        rates = rng.beta(rate * strength, (1 - rate) * strength, mazes)
    return (rng.random(mazes * size) < rates.repeat(size)).astype(float)


def logistic(rng: np.random.Generator, rate: float, of_runs: float, mazes: int, size: int, runs: int) -> np.ndarray:
    """Returns successes `[R + 1, E]`, whose log odds vary by mazes, episodes and runs.

    The last row is of another agent in the same episodes, which is not trained.
    """
    odds = special.logit(rate) + (_OF_MAZES * rng.standard_normal(mazes)).repeat(size)
    odds = odds + _OF_EPISODES * rng.standard_normal(mazes * size)
    odds = odds + np.append(of_runs * rng.standard_normal(runs), 0.0)[:, None]
    return (rng.random(odds.shape) < special.expit(odds)).astype(float)


def mean_rate(rate: float, of_runs: float) -> float:
    """Returns the mean of such successes over all runs, mazes and episodes, by quadrature."""
    deviates, weights = np.polynomial.hermite_e.hermegauss(60)
    odds = special.logit(rate) + np.sqrt(_OF_MAZES**2 + _OF_EPISODES**2 + of_runs**2) * deviates
    return float(weights @ special.expit(odds) / weights.sum())


def coverage(estimates: Iterable[Estimate], truth: float) -> str:
    """Returns the share of estimates whose interval holds the truth."""
    return f"{np.mean([each.low - 1e-12 <= truth <= each.high + 1e-12 for each in estimates]):.2f}"


def single_run(mazes: int, size: int, correlation: float, count: int) -> list[str]:
    """Returns the coverage of the mean of one run, by rate."""
    numbers, rng = np.arange(mazes).repeat(size), np.random.default_rng(0)
    cells = []
    for rate in _RATES:
        draws = (beta_binomial(rng, rate, correlation, mazes, size) for _ in range(count))
        cells.append(coverage((mean_interval(draw, numbers) for draw in draws), rate))
    return [f"{mazes} x {size}", f"{correlation:g}", *cells]


def several_runs(runs: int, of_runs: float, paired: bool, count: int) -> list[str]:
    """Returns the coverage of the mean of several runs in 48 mazes, or of its difference to the other agent's."""
    numbers, rng = np.arange(48).repeat(5), np.random.default_rng(0)
    cells = []
    for rate in _RATES_OF_RUNS:
        truth, estimates = mean_rate(rate, of_runs), []
        for _ in range(count):
            *own, other = logistic(rng, rate, of_runs, 48, 5, runs)
            estimates.append(runs_interval(np.array(own), numbers, *[other[None]] * paired))
        cells.append(coverage(estimates, truth - paired * mean_rate(rate, 0.0)))
    return [str(runs), f"{of_runs:g}", *cells]


def main(count: int) -> None:
    """Prints the tables: of single runs, of several runs, and of differences."""
    kinds = [(*sizes, by) for sizes in ((48, 5), (20, 5), (20, 75)) for by in (0.0, 0.05, 0.2)] + [(20, 1, 0.0)]
    rows = [single_run(*kind, count) for kind in kinds]
    print(format_table(["mazes x episodes", "correlation", *map(str, _RATES)], rows))
    for paired in (False, True):
        kinds = itertools.product((5, 3), (0.0, 0.3, 0.6, 1.0))
        rows = [several_runs(*kind, paired, count) for kind in kinds]
        print(format_table(["runs", "deviation of runs", *map(str, _RATES_OF_RUNS)], rows))


if __name__ == "__main__":
    main(int(sys.argv[1]) if sys.argv[1:] else 2_000)
