"""Success rate, SPL and their intervals. docs/metrics.md has the definitions with worked examples.

`E` is the number of episodes.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from mazebench.constants import ON_TIME
from mazebench.results.intervals import mean_interval
from mazebench.results.records import RECALLS, REPORTED, Figures, Record, column

# What a summary calls a metric, and the field of a record that it is the mean of.
METRICS = {"success_rate": "success", "spl": "spl", "spl_grid": "spl_grid"}
ON_TIME_METRICS = {f"on_time_{k:g}": k for k in ON_TIME}  # by the name in comparisons and reports


def spl(success: np.ndarray, shortest: np.ndarray, driven: np.ndarray) -> np.ndarray:
    """Returns `[E]` in [0, 1]: success weighted by path length, S l / max(l, p) (Anderson et al. 2018, eq. 1).

    An episode whose shortest path has length 0 scores its success: nothing was to be driven.

    Args:
      success: `[E]` bool, S.
      shortest: `[E]` m, l.
      driven: `[E]` m, p.
    """
    longest = np.maximum(shortest, driven)
    return np.where(success, np.where(shortest > 0, shortest / np.where(longest > 0, longest, 1.0), 1.0), 0.0)


def by_distance(records: Sequence[Record]) -> dict[int, list[Record]]:
    """Returns the records of each distance from start to goal, on tracks in metres, the shortest distance first."""
    distances = column(records, "asked_distance")
    return {int(each): list(itertools.compress(records, distances == each)) for each in np.unique(distances)}


def is_on_time(records: Sequence[Record], factor: float) -> np.ndarray:
    """Returns `[E]` bool: whether the goal is reached within `factor` times the oracle's steps in the episode.

    Where the oracle did not reach the goal itself, any success is on time.
    """
    limits = [math.inf if record.oracle_steps is None else factor * record.oracle_steps for record in records]
    return column(records, "success") & (column(records, "steps") <= limits)


def scores(records: Sequence[Record]) -> dict[str, np.ndarray]:
    """Returns `[E]` float by metric, of `METRICS`, `ON_TIME_METRICS` and, where all records have them, `RECALLS`."""
    are_told = all(RECALLS.keys() <= (record.model_extra or {}).keys() for record in records)
    names = METRICS | {name: name for name in RECALLS if are_told}
    found = {metric: column(records, name).astype(float) for metric, name in names.items()}
    return found | {name: is_on_time(records, k).astype(float) for name, k in ON_TIME_METRICS.items()}


def summarize(records: Sequence[Record]) -> dict[str, Any]:
    """Returns the figures of some records, at least one, by the names of the fields of `Summary` that have them."""
    facts = {name: list(itertools.compress(records, holds)) for name, holds in by_fact(records).items() if holds.any()}
    return {
        "overall": _figures(records),
        "by_distance": {str(distance): _figures(group) for distance, group in by_distance(records).items()},
        "by_fact": {name: _figures(group) for name, group in facts.items()},
    }


def by_fact(records: Sequence[Record]) -> dict[str, np.ndarray]:
    """Returns `[E]` bool for each group of records that a track tells apart: who is in it.

    The groups of a fact ("blocked") are named after it and its contrary ("not blocked"), those of mazes after the kind,
    and those of several goals after their number ("goal 1").
    """
    told = records[0].model_extra or {}
    facts = [name for name, value in told.items() if isinstance(value, bool) and name not in REPORTED]
    groups = {
        f"{'' if holds else 'not '}{fact}": column(records, fact) == holds for fact in facts for holds in (True, False)
    }
    kinds = column(records, "kind") if "kind" in told else np.empty(0)
    groups |= {kind: kinds == kind for kind in dict.fromkeys(kinds.tolist())}
    legs = column(records, "leg")
    return groups | {f"goal {leg}": legs == leg for leg in range(1, legs.max() + 1) if legs.max() > 1}


def _figures(records: Sequence[Record]) -> Figures:
    mazes = column(records, "maze")
    means = {metric: mean_interval(values, mazes) for metric, values in scores(records).items()}
    values: dict[str, Any] = {"n": len(records)}
    for metric in METRICS:
        values |= {metric: means[metric].value, f"{metric}_ci95": (means[metric].low, means[metric].high)}
    on_time = {f"{k:g}": means[metric] for metric, k in ON_TIME_METRICS.items()}
    values["on_time"] = {k: mean.value for k, mean in on_time.items()}
    values["on_time_ci95"] = {k: (mean.low, mean.high) for k, mean in on_time.items()}
    recalls = {name: means[name] for name in RECALLS if name in means}
    values["recall"] = {name: mean.value for name, mean in recalls.items()}
    values["recall_ci95"] = {name: (mean.low, mean.high) for name, mean in recalls.items()}
    return Figures.model_validate(values)
