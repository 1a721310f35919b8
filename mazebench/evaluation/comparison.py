"""Two agents on the same episodes, and several training runs of one agent. docs/metrics.md has the definitions.

`E` is the number of episodes, `R` of training runs, `T` of tasks, which are mazes.
"""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from mazebench.errors import InputError
from mazebench.evaluation.metrics import CONFIDENCE, bootstrap_interval, by_distance, wilson_interval
from mazebench.evaluation.results import Result, find_parts, load_result
from mazebench.records import Record

_METRICS = {"success_rate": "success", "spl": "spl", "spl_grid": "spl_grid"}  # and the records' names for them
_TRIMMED = 0.25  # of the scores at either end, of an interquartile mean
_NUM_RESAMPLES = 2000
_BOOTSTRAP_SEED = 0


@dataclasses.dataclass(frozen=True)
class Comparison:
    """Two folders of results held against each other."""

    title: str  # who is A and who is B, in words
    parts: dict[str, dict[str, Any]]  # what `compare_results` returns, by part; by "" for two single evaluations
    has_distances: bool  # whether the episodes of a distance are worth a line
    notes: list[str]  # on what could not be compared


def compare_folders(a: pathlib.Path, b: pathlib.Path) -> Comparison:
    """Compares two evaluations, or two runs of a suite part by part.

    Raises:
      InputError: if a folder holds no results, they are damaged, or don't pair.
    """
    a_parts, b_parts = find_parts(a), find_parts(b)
    common = [name for name in a_parts if name in b_parts]
    if not common:
        raise InputError(
            f"expected results of the same parts, found {_named(a_parts)} in {a} and {_named(b_parts)} in {b}"
        )
    notes = [
        f"{folder}: {', '.join(only)} not in the other folder; left out"
        for folder, parts in ((a, a_parts), (b, b_parts))
        if (only := [name for name in parts if name not in common])
    ]
    pairs = {name: (load_result(a_parts[name]), load_result(b_parts[name])) for name in common}
    ours, theirs = (result.summary for result in pairs[common[0]])
    task, size = ours["task"], ours["size"]
    title = f"A is {_who(ours, common)} in {a}, B is {_who(theirs, common)} in {b}"
    title += f"; {task}, {ours['split']} mazes {size} x {size}" if common == [""] else ""
    return Comparison(title, {name: compare_results(*pair) for name, pair in pairs.items()}, task == "local", notes)


def compare_results(a: Result, b: Result) -> dict[str, Any]:
    """Where A is better than B, over all episodes and by distance.

    Returns:
      dict: {"overall": {"n", and of each metric M of success_rate, spl and spl_grid "M_a", "M_b", "M_difference" (A's
       minus B's) and "M_difference_ci95", "probability_of_improvement", "probability_of_improvement_ci95"},
       "by_distance": {"1": {the same}, ...}}

    Raises:
      InputError: if the two are not of the same episodes of one version of the benchmark.
    """
    _check_pairs(a, b)
    ours, theirs = by_distance(a.records), by_distance(b.records)
    return {
        "overall": _compare(a.records, b.records),
        "by_distance": {str(distance): _compare(ours[distance], theirs[distance]) for distance in ours},
    }


def paired_difference(a: np.ndarray, b: np.ndarray, mazes: np.ndarray) -> tuple[float, tuple[float, float]]:
    """The mean of `a - b` `[E]` and its 95 % interval by a bootstrap over mazes."""
    difference = a.astype(np.float64) - b
    return float(difference.mean()), bootstrap_interval(difference, mazes)


def success_difference(a: np.ndarray, b: np.ndarray, mazes: np.ndarray) -> tuple[float, tuple[float, float]]:
    """The same of successes `[E]` bool.

    Where all episodes are ties, or all are won by one side, a bootstrap learns nothing, and Wilson's interval of that
    share, 0 or 1, stands in for it.
    """
    difference, interval = paired_difference(a, b, mazes)
    if np.ptp(a.astype(np.int64) - b) == 0:
        low, high = wilson_interval(int(abs(difference)) * len(a), len(a))
        interval = {0: (-high, high), 1: (low, high), -1: (-high, -low)}[int(difference)]
    return difference, interval


def probability_of_improvement(a: np.ndarray, b: np.ndarray, mazes: np.ndarray) -> tuple[float, tuple[float, float]]:
    """The share of episodes in which `a` `[E]` is above `b` `[E]`, a tie counting half; its interval as above."""
    wins = (a > b) + 0.5 * (a == b)
    return float(wins.mean()), bootstrap_interval(wins, mazes)


def interquartile_mean(scores: np.ndarray) -> float:
    """The mean of the middle half of all `scores` (Agarwal et al. 2021)."""
    ordered = np.sort(scores, axis=None)
    cut = int(_TRIMMED * len(ordered))
    return float(ordered[cut : len(ordered) - cut].mean())


def stratified_bootstrap_interval(
    scores: np.ndarray, statistic: Callable[[np.ndarray], float], confidence: float = CONFIDENCE
) -> tuple[float, float]:
    """Percentile interval of `statistic` of `scores` `[R, T]`: each task draws its own R runs, with replacement.

    As in rliable (Agarwal et al. 2021). It speaks of other training runs on the same mazes, not of other mazes.
    """
    num_runs, num_tasks = scores.shape
    rng = np.random.default_rng(_BOOTSTRAP_SEED)
    draws = (rng.integers(num_runs, size=scores.shape) for _ in range(_NUM_RESAMPLES))
    values = [statistic(scores[runs, np.arange(num_tasks)]) for runs in draws]
    low, high = np.quantile(values, [(1 - confidence) / 2, (1 + confidence) / 2])
    return float(low), float(high)


def pool_runs(runs: Sequence[Sequence[Record]], metric: str = "success_rate") -> dict[str, Any]:
    """Mean and interquartile mean of a metric over training runs of one agent, each evaluated on the same episodes.

    Args:
      runs: the records of each; at least two.
      metric: "success_rate", "spl" or "spl_grid".

    Returns:
      {"runs", "mean", "mean_ci95", "iqm", "iqm_ci95"}

    Raises:
      InputError: if there are fewer than two, or they differ in their episodes.
    """
    if len(runs) < 2:
        raise InputError(f"expected at least two training runs to pool, found {len(runs)}")
    for number, run in enumerate(runs[1:], 2):
        fault = _other_episode(runs[0], run)
        if fault:
            raise InputError(f"expected training runs evaluated on the same episodes, found in run {number} {fault}")
    scores = np.array([_maze_scores(run, _METRICS[metric]) for run in runs])
    return {
        "runs": len(runs),
        "mean": float(scores.mean()),
        "mean_ci95": list(stratified_bootstrap_interval(scores, lambda values: float(values.mean()))),
        "iqm": interquartile_mean(scores),
        "iqm_ci95": list(stratified_bootstrap_interval(scores, interquartile_mean)),
    }


def _compare(a: Sequence[Record], b: Sequence[Record]) -> dict[str, Any]:
    mazes = np.array([record["maze"] for record in a])
    row: dict[str, Any] = {"n": len(a)}
    for metric, name in _METRICS.items():
        ours, theirs = (np.array([record[name] for record in records]) for records in (a, b))
        measure = success_difference if metric == "success_rate" else paired_difference
        difference, interval = measure(ours, theirs, mazes)
        row |= {f"{metric}_a": float(ours.mean()), f"{metric}_b": float(theirs.mean())}
        row |= {f"{metric}_difference": difference, f"{metric}_difference_ci95": list(interval)}
        if metric == "spl":
            probability, interval = probability_of_improvement(ours, theirs, mazes)
            row |= {"probability_of_improvement": probability, "probability_of_improvement_ci95": list(interval)}
    return row


def _named(parts: dict[str, pathlib.Path]) -> str:
    return ", ".join(name or "a single evaluation" for name in parts)


def _who(summary: dict[str, Any], parts: list[str]) -> str:
    """The agent and, of a single evaluation, the perturbation."""
    perturbed = [f"{key} {value}" for key, value in summary["perturbation"].items() if value and parts == [""]]
    return f"{summary['agent']}{' (' + ', '.join(perturbed) + ')' if perturbed else ''}"


def _check_pairs(a: Result, b: Result) -> None:
    for key, ours, theirs in (
        *((key, a.summary[key], b.summary[key]) for key in ("benchmark", "task", "size", "split")),
        *(
            (key, a.summary["provenance"].get(key), b.summary["provenance"].get(key))
            for key in ("benchmark_manifest_sha256", "mazes_sha256")
        ),
    ):
        if ours != theirs:
            raise InputError(
                f"expected results of one {key} to compare, found {str(ours)[:80]} in {a.folder} "
                f"and {str(theirs)[:80]} in {b.folder}"
            )
    fault = _other_episode(a.records, b.records)
    if fault:
        raise InputError(f"expected the same episodes in {a.folder} and {b.folder}, found {fault}")


def _other_episode(a: Sequence[Record], b: Sequence[Record]) -> str | None:
    """The first episode in which the two differ, in words."""
    for ours, theirs in zip(a, b, strict=False):
        for key in ("maze", "start", "goal", "seed", "distance"):
            if ours[key] != theirs[key]:
                return f"episode {ours['episode']} with {key} {ours[key]} and {theirs[key]}"
    return None if len(a) == len(b) else f"{len(a)} and {len(b)} of them"


def _maze_scores(records: Sequence[Record], name: str) -> list[float]:
    """`[T]`: the mean of each maze's episodes."""
    scores: dict[str, list[float]] = {}
    for record in records:
        scores.setdefault(record["maze"], []).append(float(record[name]))
    return [float(np.mean(values)) for values in scores.values()]
