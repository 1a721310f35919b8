"""Success rate, SPL and their intervals. docs/metrics.md has the definitions with worked examples.

`E` is the number of episodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import stats

CONFIDENCE = 0.95
_NUM_RESAMPLES = 2000
_BOOTSTRAP_SEED = 0
_DRAWN_AT_ONCE = 2**20  # numbers, 8 MiB


def spl(success: np.ndarray, shortest: np.ndarray, driven: np.ndarray) -> np.ndarray:
    """`[E]` in [0, 1]: success weighted by path length, S l / max(l, p) (Anderson et al. 2018, eq. 1).

    An episode whose shortest path has length 0 scores its success: nothing was to be driven.

    Args:
      success: `[E]` bool, S.
      shortest: `[E]` m, l.
      driven: `[E]` m, p.
    """
    longest = np.maximum(shortest, driven)
    return np.where(success, np.where(shortest > 0, shortest / np.where(longest > 0, longest, 1.0), 1.0), 0.0)


def wilson_interval(successes: int, trials: int, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Wilson's score interval of a rate (Wilson 1927)."""
    interval = stats.binomtest(successes, trials).proportion_ci(confidence, method="wilson")
    return float(interval.low), float(interval.high)


def bootstrap_interval(values: np.ndarray, clusters: np.ndarray, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Percentile interval of the mean of `values` `[E]`, by resampling whole clusters `[E]` (mazes), seeded.

    The episodes of one maze are not independent, so mazes are drawn with replacement, each with all its episodes. Where
    there is only one maze, its episodes are drawn.
    """
    _, index = np.unique(clusters, return_inverse=True)
    if index.max() == 0:
        index = np.arange(len(values))
    sums, counts = np.bincount(index, weights=values), np.bincount(index)
    rng = np.random.default_rng(_BOOTSTRAP_SEED)
    means = np.empty(_NUM_RESAMPLES)
    # So many at a time that the memory does not grow with the clusters; the numbers drawn are the same.
    at_once = max(1, _DRAWN_AT_ONCE // len(sums))
    for start in range(0, _NUM_RESAMPLES, at_once):
        drawn = rng.integers(len(sums), size=(min(at_once, _NUM_RESAMPLES - start), len(sums)))
        means[start : start + at_once] = sums[drawn].sum(axis=1) / counts[drawn].sum(axis=1)
    low, high = np.quantile(means, [(1 - confidence) / 2, (1 + confidence) / 2])
    return float(low), float(high)


def success_interval(success: np.ndarray, mazes: np.ndarray) -> tuple[float, float]:
    """The bootstrap's interval; Wilson's where all episodes ended alike, of which the bootstrap learns nothing."""
    if success.all() or not success.any():
        return wilson_interval(int(success.sum()), len(success))
    return bootstrap_interval(success.astype(np.float64), mazes)


def summarize(records: list[dict[str, Any]]) -> dict[str, Any]:
    """Means and 95 % intervals of success rate, SPL and SPL by grid distance, overall and by distance.

    Returns:
      dict: {"overall": {"n", "success_rate", "success_rate_ci95", "spl", "spl_ci95", "spl_grid", "spl_grid_ci95"},
       "by_distance": {"1": {the same}, ...}}
    """
    return {
        "overall": _aggregate(records),
        "by_distance": {str(distance): _aggregate(those) for distance, those in by_distance(records).items()},
    }


def by_distance(records: Sequence[dict[str, Any]]) -> dict[int, list[dict[str, Any]]]:
    """The records of each distance from start to goal, in its order."""
    groups: dict[int, list[dict[str, Any]]] = {}
    for record in records:
        groups.setdefault(record["distance"], []).append(record)
    return dict(sorted(groups.items()))


def _aggregate(records: list[dict[str, Any]]) -> dict[str, Any]:
    mazes = np.array([record["maze"] for record in records])
    success = np.array([record["success"] for record in records])
    result: dict[str, Any] = {
        "n": len(records),
        "success_rate": float(success.mean()),
        "success_rate_ci95": list(success_interval(success, mazes)),
    }
    for key in ("spl", "spl_grid"):
        values = np.array([record[key] for record in records])
        result[key] = float(values.mean())
        result[f"{key}_ci95"] = list(bootstrap_interval(values, mazes))
    return result
