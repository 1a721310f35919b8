"""The metrics of episodes, their means and intervals. docs/metrics.md has the definitions with worked examples.

`E` is the number of episodes.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from mazebench.constants import ON_TIME
from mazebench.results.intervals import Estimate, mean_interval
from mazebench.results.records import Figures, Record, column


@dataclasses.dataclass(frozen=True, kw_only=True)
class Metric:
    """A number in [0, 1] of each episode, whose mean is reported with a 95 % interval."""

    name: str  # in comparisons, and in tables as files
    title: str  # of a report's table
    head: str  # of its column on a terminal, which metrics with the same head share
    of: Callable[[Sequence[Record]], np.ndarray]  # returns `[E]`
    shows_interval: bool = False  # on a terminal
    needs: str | None = None  # a further key of records, without which there is no such metric
    group: str = ""  # in a summary: its mean is under `key` of this group, or else under its own name
    key: str = ""

    def estimate(self, figures: Figures) -> Estimate | None:
        """Returns the mean in some figures of a summary; None if they have none."""
        mean, ends = (getattr(figures, (self.group or self.name) + suffix, None) for suffix in ("", "_ci95"))
        if self.group and mean and ends:
            mean, ends = mean.get(self.key), ends.get(self.key)
        return Estimate(mean, *ends) if isinstance(mean, float) and ends else None


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


def _field(name: str) -> Callable[[Sequence[Record]], np.ndarray]:
    return functools.partial(column, name=name)


SUCCESS_RATE = Metric(
    name="success_rate", title="success rate", head="success rate", of=_field("success"), shows_interval=True
)
ON_TIMES = tuple(
    Metric(
        name=f"on_time_{factor:g}",
        title=f"on time ({factor:g})",
        head="on time",
        of=functools.partial(is_on_time, factor=factor),
        group="on_time",
        key=f"{factor:g}",
    )
    for factor in ON_TIME
)
SPL = Metric(name="spl", title="SPL", head="SPL", of=_field("spl"), shows_interval=True)
SPL_GRID = Metric(name="spl_grid", title="SPL by grid distance", head="SPL by grid", of=_field("spl_grid"))
# Of the poses that an agent reports, over an episode and in its last step.
RECALLS = tuple(
    Metric(name=name, title=title, head=head, of=_field(name), needs=name, group="recall", key=name)
    for name, title, head in (
        ("recall_1m", "pose within 1 m", "pose 1 m"),
        ("recall_1m_30deg", "pose within 1 m and 30 degrees", "pose 1 m, 30 deg"),
        ("final_recall_1m", "pose at the end within 1 m", "pose 1 m"),
        ("final_recall_1m_30deg", "pose at the end within 1 m and 30 degrees", "pose 1 m, 30 deg"),
    )
)
METRICS = {metric.name: metric for metric in (SUCCESS_RATE, *ON_TIMES, SPL, SPL_GRID, *RECALLS)}
HEADLINE = (SUCCESS_RATE, ON_TIMES[0], SPL)  # where there is room for three


def scores(records: Sequence[Record]) -> dict[str, np.ndarray]:
    """Returns `[E]` float by the names of `METRICS`, without those that not all records have."""
    told = set.intersection(*({None, *(record.model_extra or {})} for record in records))
    return {name: metric.of(records).astype(float) for name, metric in METRICS.items() if metric.needs in told}


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
    facts = [name for name, value in told.items() if isinstance(value, bool) and name != "notes"]
    groups = {
        f"{'' if holds else 'not '}{fact}": column(records, fact) == holds for fact in facts for holds in (True, False)
    }
    kinds = column(records, "kind") if "kind" in told else np.empty(0)
    groups |= {kind: kinds == kind for kind in dict.fromkeys(kinds.tolist())}
    legs = column(records, "leg")
    return groups | {f"goal {leg}": legs == leg for leg in range(1, legs.max() + 1) if legs.max() > 1}


def _figures(records: Sequence[Record]) -> Figures:
    mazes, values = column(records, "maze"), dict[str, Any](n=len(records))
    for name, of_episodes in scores(records).items():
        metric, mean = METRICS[name], mean_interval(of_episodes, mazes)
        for suffix, value in (("", mean.value), ("_ci95", (mean.low, mean.high))):
            if metric.group:
                values.setdefault(metric.group + suffix, {})[metric.key] = value
            else:
                values[name + suffix] = value
    return Figures.model_validate(values)
