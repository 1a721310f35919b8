"""95 % intervals of means over episodes, of paired differences, and of means over training runs.

`E` is the number of episodes, `R` of training runs. docs/intervals.md has worked examples and
a simulation of the coverage.
"""

from __future__ import annotations

import dataclasses
import functools

import numpy as np
import scipy

CONFIDENCE = 0.95

# How much alike the outcomes of one maze's episodes are taken to be where the data do not say: the correlation of two.
DEFAULT_CORRELATION = 0.1
# The weight of that default, in independent episodes. Wilson's interval itself adds z^2 = 3.8 of them, half of either
# kind. With 2 or more, the lower bound never falls when a last failure becomes a success.
_DEFAULT_WEIGHT = 2.0
_UPPER_TAIL = (1 + CONFIDENCE) / 2
_NUM_DRAWS = 4000  # of a bootstrap
_MOST_DRAWN = 1000  # mazes
_EQUAL = 1e-9  # differences of mazes' means that are none


@dataclasses.dataclass(frozen=True)
class Estimate:
    """A figure and its 95 % interval."""

    value: float
    low: float
    high: float


def wilson_interval(rate: float, num_trials: float) -> tuple[float, float]:
    """Returns Wilson's score interval of a rate in [0, 1] (Wilson 1927); `num_trials` > 0 need not be whole."""
    z = scipy.special.ndtri(_UPPER_TAIL)
    centre = rate + z**2 / (2 * num_trials)
    half_width = z * np.sqrt(rate * (1 - rate) / num_trials + z**2 / (4 * num_trials**2))
    scale = 1 + z**2 / num_trials
    # Rounding must not take the interval past its ends, or past the rate at 0 and 1.
    low, high = (centre - half_width) / scale, (centre + half_width) / scale
    return float(np.clip(low, 0, rate)), float(np.clip(high, rate, 1))


def mean_interval(values: np.ndarray, mazes: np.ndarray) -> Estimate:
    """Returns the mean of values in [0, 1], successes or SPL, with Wilson's interval at the effective sample size.

    The effective sample size is E / d (Korn and Graubard 1998; Dean and Pagano 2015). The design effect d is estimated
    by a formula of our own, which shrinks the usual one, S / (E p (1 - p)), toward a default:

        d = (S + w d0^2) / (E p (1 - p) + w d0),    at most m,    w = 2.

    docs/intervals.md has a simulation of its coverage. p is the mean, S the sum over mazes of the squared deviations of
    the mazes' sums (`_squares_by_maze`), m the mean number of episodes that an episode shares its maze with, itself
    included, and d0 = 1 + (m - 1) 0.1 the design effect for the default correlation (Kish 1965). E p (1 - p) is S as it
    is expected for independent successes. The data prevail where failures and successes are many, the default where
    either is rare.

    With one maze the episodes are taken as independent, and the interval speaks of that maze only.

    Args:
      values: `[E]` in [0, 1].
      mazes: `[E]`, any names or numbers.
    """
    mean, clusters = float(np.mean(values)), _clusters(mazes)
    squares = _squares_by_maze(values - mean, clusters)
    default, largest = _default_effect(clusters), _mean_size(clusters)
    weight = _DEFAULT_WEIGHT * default
    effect = min((squares + weight * default) / (len(values) * mean * (1 - mean) + weight), largest)
    return Estimate(mean, *wilson_interval(mean, len(values) / effect))


def difference_interval(differences: np.ndarray, mazes: np.ndarray, largest: float = 1.0) -> Estimate:
    """Returns the mean of paired differences in [-largest, largest] with the interval of a bootstrap over mazes.

    Whole mazes are drawn again with replacement, always by the same random numbers (Efron and Tibshirani 1993, ch. 13).
    The quantiles of the means of these draws are moved away from the mean by the factor

        sqrt(K / (K - 1)) t(K - 1) / z,

    by which intervals of means of K values are wider than the bootstrap's; t and z are quantiles. With one maze,
    episodes are drawn again. The interval is that of `_adjusted_interval` where all mazes have equal means, for then no
    draw tells how far others might be, and from 1,000 mazes on. docs/intervals.md has a simulation of the coverage.

    Args:
      differences: `[E]` in [-largest, largest], of one episode each.
      mazes: `[E]`, any names or numbers.
      largest: above 0, in the unit of the differences.
    """
    if largest != 1:
        of_unit = difference_interval(differences / largest, mazes)
        return Estimate(*(largest * end for end in (of_unit.value, of_unit.low, of_unit.high)))
    clusters = _clusters(mazes)
    mean = float(np.mean(differences))
    num_clusters = int(clusters.max()) + 1
    sums, sizes = (np.bincount(clusters, weights=each) for each in (differences, np.ones(len(clusters))))
    if np.ptp(sums / sizes) < _EQUAL or num_clusters > _MOST_DRAWN:
        return Estimate(mean, *_adjusted_interval(differences, clusters))

    # The mean of each draw: the sum over its mazes by the number of their episodes.
    draws = _draws(num_clusters)
    means = draws @ sums / (draws @ sizes)
    low, high = np.quantile(means, (1 - _UPPER_TAIL, _UPPER_TAIL))
    wider = np.sqrt(num_clusters / (num_clusters - 1)) * scipy.special.stdtrit(num_clusters - 1, _UPPER_TAIL)
    wider /= scipy.special.ndtri(_UPPER_TAIL)
    low, high = (mean + wider * min(low - mean, 0.0), mean + wider * max(high - mean, 0.0))
    return Estimate(mean, float(max(low, -1)), float(min(high, 1)))


@functools.lru_cache(maxsize=8)
def _draws(num_clusters: int) -> np.ndarray:
    """Returns how often each of K mazes is in each draw of a bootstrap: `[D, K]` float."""
    shares = np.full(num_clusters, 1 / num_clusters)
    return np.random.default_rng(0).multinomial(num_clusters, shares, _NUM_DRAWS).astype(float)


def _adjusted_interval(differences: np.ndarray, clusters: np.ndarray) -> tuple[float, float]:
    """Returns an interval of paired differences `[E]` adjusted after Bonett and Price (2012).

    They add a pair that is won and one that is lost before they compute the usual interval. The version for mazes is
    our own: both pairs count for d0 episodes, the default design effect of `mean_interval`, and S is over mazes as
    there.

        mean~ = sum / (E + 2 d0),    variance = (S + d0^2 ((1 - mean~)^2 + (1 + mean~)^2)) / (E + 2 d0)^2.

    With one episode a maze, or a single maze, this is Bonett and Price's interval.
    """
    default = _default_effect(clusters)
    count = len(differences) + 2 * default
    centre = float(np.sum(differences)) / count
    squares = _squares_by_maze(differences - centre, clusters)
    squares += default**2 * ((1 - centre) ** 2 + (1 + centre) ** 2)
    half_width = scipy.special.ndtri(_UPPER_TAIL) * np.sqrt(squares) / count
    return float(max(centre - half_width, -1)), float(min(centre + half_width, 1))


def runs_interval(values: np.ndarray, mazes: np.ndarray, others: np.ndarray | None = None) -> Estimate:
    """Returns a mean over training runs and mazes, or the difference of two, with an interval over both together.

    The half-widths of two intervals add as squares, after Zou and Donner (2008): that over mazes, `mean_interval` or
    `difference_interval` of each episode's mean over the runs, and Student's over runs (Welch's of a difference).
    docs/intervals.md has a simulation of its coverage: too wide where runs differ little, since the chance in single
    episodes is in both parts, and too narrow where runs near 1 differ much.

    Args:
      values: `[R, E]` in [0, 1], of R training runs in the same E episodes; one run if the agent is not trained:
        a single run adds nothing to the interval.
      mazes: `[E]`, any names or numbers.
      others: `[R', E]`, R' runs of another agent in these episodes, whose mean is taken off.
    """
    if others is None:
        runs, lowest = [values], 0.0
        over_mazes = mean_interval(values.mean(axis=0), mazes)
    else:
        runs, lowest = [values, others], -1.0
        over_mazes = difference_interval(values.mean(axis=0) - others.mean(axis=0), mazes)

    means = [of_agent.mean(axis=1) for of_agent in runs if len(of_agent) > 1]
    variances = np.array([np.var(each, ddof=1) / len(each) for each in means])
    half_width = 0.0
    if variances.any():
        freedom = variances.sum() ** 2 / (variances**2 / [len(each) - 1 for each in means]).sum()
        half_width = scipy.special.stdtrit(freedom, _UPPER_TAIL) * np.sqrt(variances.sum())
    value = over_mazes.value
    low, high = (np.hypot(value - end, half_width) for end in (over_mazes.low, over_mazes.high))
    return Estimate(value, float(max(value - low, lowest)), float(min(value + high, 1)))


def _clusters(mazes: np.ndarray) -> np.ndarray:
    """Returns `[E]` int, which episodes hang together: those of a maze; none where there is only one maze."""
    _, clusters = np.unique(mazes, return_inverse=True)
    return clusters if clusters.any() else np.arange(len(mazes))


def _mean_size(clusters: np.ndarray) -> float:
    """Returns m: the number of episodes in an episode's cluster, averaged over episodes (Kish 1965)."""
    return float((np.bincount(clusters) ** 2).sum() / len(clusters))


def _default_effect(clusters: np.ndarray) -> float:
    return 1 + (_mean_size(clusters) - 1) * DEFAULT_CORRELATION


def _squares_by_maze(residuals: np.ndarray, clusters: np.ndarray) -> float:
    """Returns S, the sum of squares of the clusters' sums of `residuals` `[E]`: E^2 times the mean's variance.

    It is the linearised variance of a ratio with K clusters, K / (K - 1) times the sum of squares, inflated by the
    squared ratio of the t quantiles with K - 1 and E - 1 degrees of freedom (Korn and Graubard 1998). It lies between
    the sum of squares of single episodes, if the clusters told nothing, and m times that, if the episodes of each were
    all alike.
    """
    independent = float((residuals**2).sum())
    num_clusters = clusters.max() + 1
    if num_clusters == len(clusters):
        return independent
    few = scipy.special.stdtrit(num_clusters - 1, _UPPER_TAIL) / scipy.special.stdtrit(len(clusters) - 1, _UPPER_TAIL)
    sums = np.bincount(clusters, weights=residuals)
    squares = few**2 * num_clusters / (num_clusters - 1) * (sums**2).sum()
    return float(np.clip(squares, independent, _mean_size(clusters) * independent))
