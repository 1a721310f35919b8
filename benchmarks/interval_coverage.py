"""Simulates how often 95 % intervals contain the true figure, and how wide they are; prints Markdown tables.

`R` is the number of simulated evaluations, `K` of mazes, `M` of episodes in each. The successes of one maze are
beta-binomial: every maze draws a success rate of its own, so that two of its episodes have the given correlation.
"new" is `mazebench.results.intervals`, "old" the method that it replaced: a percentile bootstrap over mazes, with
Wilson's interval of independent episodes where all episodes ended alike. docs/metrics.md shows what this prints.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy import special

from mazebench.results.intervals import difference_interval, mean_interval, runs_interval, wilson_interval

NUM_EVALUATIONS = 2000
NUM_RESAMPLES = 2000
DESIGNS = (
    *((20, 5, correlation) for correlation in (0.0, 0.05, 0.2)),
    *((20, 75, correlation) for correlation in (0.0, 0.05, 0.2)),
    (20, 1, 0.0),
)
RATES = (0.02, 0.1, 0.5, 0.8, 0.9, 0.95, 0.98, 0.99, 1.0)
WINS_AND_LOSSES = ((0.0, 0.0), (0.02, 0.02), (0.05, 0.02), (0.1, 0.1), (0.2, 0.05), (0.6, 0.02))
# Standard deviations of training runs and of mazes, on the logit scale.
SPREADS = ((0.0, 0.0), (0.0, 1.0), (0.3, 0.5), (0.6, 0.5), (1.0, 0.5))
EFFICIENCY = (0.7, 1.0)  # of successful episodes, whose SPL is uniform between them


def main() -> None:
    """Prints coverage and width for success rates, SPL and paired differences."""
    rates = {f"{rate:g}": rate for rate in RATES}
    shares = {f"{win:g}, {loss:g}": (win, loss) for win, loss in WINS_AND_LOSSES}
    new_mean, new_difference = (functools.partial(new_interval, of) for of in (mean_interval, difference_interval))
    print_tables("Success rate", rates, draw_successes, old_rate_interval, new_mean)
    print_tables("SPL, by success rate", rates, draw_spl, bootstrap_interval, new_mean)
    title = "Difference of success, by shares of wins and losses"
    print_tables(title, shares, draw_outcomes, old_difference_interval, new_difference)
    print_runs()


def print_runs() -> None:
    """Prints tables of coverage and mean width over training runs and mazes together: of means, and of differences."""
    print_runs_table("Mean over training runs and mazes, by success rate", [(rate,) for rate in (0.5, 0.8, 0.95, 0.99)])
    pairs = [(0.5, 0.5), (0.95, 0.95), (0.8, 0.5), (0.95, 0.8), (0.99, 0.95)]
    print_runs_table("Difference over training runs and mazes, by the two success rates", pairs)


def print_runs_table(title: str, settings: Sequence[tuple[float, ...]]) -> None:
    """Prints a table with a column for each of `settings`: a success rate, or those of two agents."""
    columns = (" and ".join(map(str, rates)) for rates in settings)
    print(f"\n{title}: coverage, mean width\n")
    for line in (("runs", "mazes x episodes", "spread of runs, mazes", *columns), ["---"] * (3 + len(settings))):
        print(f"| {' | '.join(line)} |")
    for num_runs, (num_mazes, num_episodes), spreads in itertools.product((3, 5), ((20, 5), (100, 2)), SPREADS):
        mazes = np.arange(num_mazes).repeat(num_episodes)
        cells = []
        for rates in settings:
            values, truths = draw_runs(rates, num_runs, num_mazes, num_episodes, spreads, np.random.default_rng(0))
            agents = [each.reshape(NUM_EVALUATIONS, num_runs, -1) for each in values]
            estimates = [runs_interval(ours, mazes, *others) for ours, *others in zip(*agents, strict=True)]
            truth = truths[0] - sum(truths[1:])
            covered = np.mean([each.low <= truth <= each.high for each in estimates])
            cells.append(f"{covered:.2f}, {np.mean([each.high - each.low for each in estimates]):.2f}")
        design = (str(num_runs), f"{num_mazes} x {num_episodes}", ", ".join(map(str, spreads)))
        print(f"| {' | '.join((*design, *cells))} |", flush=True)


def draw_runs(
    rates: Sequence[float],
    num_runs: int,
    num_mazes: int,
    num_episodes: int,
    spreads: tuple[float, float],
    rng: np.random.Generator,
) -> tuple[list[np.ndarray], list[float]]:
    """Returns successes `[R, runs, K, M]` of each agent in the same mazes, and their expectations.

    Logits are normal about that of the agent's rate. What a maze adds to it, it adds for all agents.
    """
    of_runs, of_mazes = spreads
    mazes = of_mazes * rng.normal(size=(NUM_EVALUATIONS, 1, num_mazes, 1))
    drawn, truths = [], []
    for rate in rates:
        logit = np.log(rate / (1 - rate))
        truths.append(float(special.expit(logit + np.hypot(of_runs, of_mazes) * rng.normal(size=100_000)).mean()))
        chances = special.expit(logit + mazes + of_runs * rng.normal(size=(NUM_EVALUATIONS, num_runs, 1, 1)))
        drawn.append((rng.random((NUM_EVALUATIONS, num_runs, num_mazes, num_episodes)) < chances).astype(float))
    return drawn, truths


def print_tables(title: str, settings: Mapping[str, Any], draw: Callable, old: Callable, new: Callable) -> None:
    """Prints a table of coverage and one of mean width, with a column for each of `settings`."""
    head = ["mazes x episodes", "correlation", "interval", *settings]
    tables: dict[str, list[list[str]]] = {"coverage": [], "mean width": []}
    for num_mazes, num_episodes, correlation in DESIGNS:
        rows = {name: ([], []) for name in ("old", "new")}
        for setting in settings.values():
            rng = np.random.default_rng(0)
            values, truth = draw(setting, num_mazes, num_episodes, correlation, rng)
            for (coverage, width), method in zip(rows.values(), (old, new), strict=True):
                low, high = method(values)
                coverage.append(f"{np.mean((low <= truth + 1e-12) & (truth - 1e-12 <= high)):.2f}")
                width.append(f"{np.mean(high - low):.3f}")
        for name, texts in rows.items():
            for table, cells in zip(tables.values(), texts, strict=True):
                table.append([f"{num_mazes} x {num_episodes}", f"{correlation:g}", name, *cells])
    for measure, lines in tables.items():
        print(f"\n{title}: {measure}\n")
        for line in (head, ["---"] * len(head), *lines):
            print(f"| {' | '.join(line)} |")


def draw_successes(
    rate: float, num_mazes: int, num_episodes: int, correlation: float, rng: np.random.Generator
) -> tuple[np.ndarray, float]:
    """Returns `[R, K, M]` of 0 and 1, and their expectation."""
    rates = np.full((NUM_EVALUATIONS, num_mazes, 1), rate)
    if correlation and rate < 1:
        strength = 1 / correlation - 1
        rates = rng.beta(rate * strength, (1 - rate) * strength, rates.shape)
    return (rng.random((NUM_EVALUATIONS, num_mazes, num_episodes)) < rates).astype(float), rate


def draw_spl(
    rate: float, num_mazes: int, num_episodes: int, correlation: float, rng: np.random.Generator
) -> tuple[np.ndarray, float]:
    """Returns `[R, K, M]` in [0, 1], and their expectation."""
    successes, _ = draw_successes(rate, num_mazes, num_episodes, correlation, rng)
    return successes * rng.uniform(*EFFICIENCY, successes.shape), rate * sum(EFFICIENCY) / 2


def draw_outcomes(
    shares: tuple[float, float], num_mazes: int, num_episodes: int, correlation: float, rng: np.random.Generator
) -> tuple[np.ndarray, float]:
    """Returns `[R, K, M]` of 1 for a win, -1 for a loss and 0 for a tie, and their expectation."""
    win, loss = shares
    chances = np.broadcast_to([win, loss], (NUM_EVALUATIONS, num_mazes, 2))
    if correlation and win:
        strength = 1 / correlation - 1
        parameters = np.array([win, loss, 1 - win - loss]) * strength
        chances = rng.dirichlet(parameters, (NUM_EVALUATIONS, num_mazes))[..., :2]
    drawn = rng.random((NUM_EVALUATIONS, num_mazes, num_episodes))
    wins = drawn < chances[..., :1]
    losses = ~wins & (drawn < chances.sum(axis=-1, keepdims=True))
    return wins.astype(float) - losses, win - loss


def new_interval(interval: Callable, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns `[R]` low and `[R]` high ends."""
    mazes = np.arange(values.shape[1]).repeat(values.shape[2])
    estimates = [interval(evaluation.ravel(), mazes) for evaluation in values]
    return np.array([estimate.low for estimate in estimates]), np.array([estimate.high for estimate in estimates])


def bootstrap_interval(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns `[R]` low and `[R]` high ends: percentiles of the mean when mazes are drawn with replacement."""
    num_mazes = values.shape[1]
    counts = np.random.default_rng(0).multinomial(num_mazes, np.full(num_mazes, 1 / num_mazes), NUM_RESAMPLES)
    means = values.mean(axis=2) @ counts.T / num_mazes  # [R, resamples]
    low, high = np.quantile(means, [0.025, 0.975], axis=1)
    return low, high


def old_rate_interval(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns `[R]` low and `[R]` high ends, Wilson's where all episodes ended alike."""
    low, high = bootstrap_interval(values)
    bound, _ = wilson_interval(1.0, values[0].size)
    low[values.all(axis=(1, 2))] = bound
    high[~values.any(axis=(1, 2))] = 1 - bound
    return low, high


def old_difference_interval(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Returns `[R]` low and `[R]` high ends, Wilson's for the share of decided episodes where all are ties."""
    low, high = bootstrap_interval(values)
    bound, _ = wilson_interval(1.0, values[0].size)
    ties = ~values.any(axis=(1, 2))
    low[ties], high[ties] = bound - 1, 1 - bound
    return low, high


if __name__ == "__main__":
    main()
