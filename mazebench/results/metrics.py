"""Success rate, SPL and their intervals. docs/metrics.md has the definitions with worked examples.

`E` is the number of episodes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mazebench.results.intervals import mean_interval
from mazebench.results.records import Figures, Record, column

# What a summary calls a metric, and the field of a record that it is the mean of.
METRICS = {"success_rate": "success", "spl": "spl", "spl_grid": "spl_grid"}


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
    """Returns the records of each distance from start to goal, the shortest distance first."""
    distances = column(records, "distance")
    return {
        int(distance): [records[index] for index in np.flatnonzero(distances == distance).tolist()]
        for distance in np.unique(distances)
    }


def summarize(
    records: Sequence[Record], oracle_spl: Mapping[int, float] | None = None
) -> tuple[Figures, dict[str, Figures]]:
    """Returns the figures of all records, and those of each distance from start to goal.

    Args:
      records: of an evaluation, at least one.
      oracle_spl: the oracle's SPL in each of these episodes, by index; None if it is not known.
    """
    groups = {str(distance): _figures(group, oracle_spl) for distance, group in by_distance(records).items()}
    return _figures(records, oracle_spl), groups


def summarize_facts(records: Sequence[Record], oracle_spl: Mapping[int, float] | None = None) -> dict[str, Figures]:
    """Returns the figures of the records in which a fact holds, such as "blocked", and where it does not.

    Args:
      records, oracle_spl: as for `summarize`; on some tracks, records tell facts.
    """
    return {
        name: _figures([records[index] for index in np.flatnonzero(holds).tolist()], oracle_spl)
        for name, holds in by_fact(records).items()
        if holds.any()
    }


def by_fact(records: Sequence[Record]) -> dict[str, np.ndarray]:
    """Returns `[E]` bool for each fact of the records ("blocked") and its contrary ("not blocked"): where it holds."""
    facts = [name for name, value in (records[0].model_extra or {}).items() if isinstance(value, bool)]
    return {
        f"{'' if holds else 'not '}{fact}": column(records, fact) == holds for fact in facts for holds in (True, False)
    }


def _figures(records: Sequence[Record], oracle_spl: Mapping[int, float] | None) -> Figures:
    mazes = column(records, "maze")
    values: dict[str, Any] = {"n": len(records), "spl_relative": None}
    for metric, name in METRICS.items():
        estimate = mean_interval(column(records, name), mazes)
        values |= {metric: estimate.value, f"{metric}_ci95": (estimate.low, estimate.high)}
    if oracle_spl is not None:
        values["spl_relative"] = values["spl"] / float(np.mean([oracle_spl[record.episode] for record in records]))
    return Figures.model_validate(values)
