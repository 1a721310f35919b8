"""Tables filled with the metrics of results over the episodes of each row.

`E` is the number of episodes of a result.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from mazebench.report.results import METRICS, ReportedResult
from mazebench.report.rows import Row
from mazebench.report.table import METRIC_NAMES, SPL_RELATIVE, UNTRAINED_NOTE, Cell, Column, Table
from mazebench.results.intervals import mean_interval


def make_table(
    name: str,
    title: str,
    note: str,
    row_name: str,
    rows: Mapping[str, Row],
    x: tuple[float, ...],
    results: Sequence[ReportedResult],
    labels: Sequence[str],
    paper: Sequence[Column] = (),
) -> Table:
    """Returns a table with a column for each of `labels` that has a result, and the paper's columns behind them."""
    by_label = {label: [result for result in results if result.label == label] for label in labels}
    cells = {label: [_measure_row(row, own) for row in rows.values()] for label, own in by_label.items() if own}
    if not all(SPL_RELATIVE in row for column in cells.values() for row in column if row):
        for row in (row for column in cells.values() for row in column):
            row.pop(SPL_RELATIVE, None)
    if any(cell.is_untrained_scale for column in cells.values() for row in column for cell in row.values()):
        note = f"{note} {UNTRAINED_NOTE}".strip()
    measured = [
        Column(label, False, {metric: tuple(row.get(metric) for row in column) for metric in METRIC_NAMES})
        for label, column in cells.items()
    ]
    return Table(name, title, note, row_name, tuple(rows), x, (*measured, *paper))


def measure(result: ReportedResult, chosen: np.ndarray) -> dict[str, Cell]:
    """Returns the metrics over the `chosen` (`[E]` bool) episodes, with 95 % intervals; nothing if none are chosen."""
    count = int(chosen.sum())
    if not count:
        return {}
    episodes = result.episodes
    cells = {}
    for metric in METRICS:
        estimate = mean_interval(episodes.values(metric)[chosen], episodes.maze[chosen])
        cells[metric] = Cell(estimate.value, estimate.low, estimate.high, count)
    relative = _spl_relative(result, chosen)
    if relative is not None:
        cells[SPL_RELATIVE] = Cell(relative, episodes=count)
    is_marked = result.summary.untrained_scale
    return {metric: dataclasses.replace(cell, is_untrained_scale=is_marked) for metric, cell in cells.items()}


def _measure_row(row: Row, results: Sequence[ReportedResult]) -> dict[str, Cell]:
    """Returns the metrics of the first result that has episodes in a row; nothing if there is none."""
    return next((cells for result in results if (cells := measure(result, row(result)))), {})


def _spl_relative(result: ReportedResult, chosen: np.ndarray) -> float | None:
    """Returns the SPL divided by the oracle's, by what the summary says of all episodes, each fact and each distance.

    None if the summary does not say it of these episodes.
    """
    if chosen.all():
        return result.summary.overall.spl_relative
    for fact, holds in result.episodes.facts.items():
        if fact in result.summary.by_fact and np.array_equal(chosen, holds):
            return result.summary.by_fact[fact].spl_relative
    figures = [result.summary.by_distance[str(d)] for d in np.unique(result.episodes.distance[chosen]).tolist()]
    if sum(each.n for each in figures) != chosen.sum():
        return None
    if len(figures) == 1:
        return figures[0].spl_relative
    ours = oracles = 0.0
    for each in figures:
        if not each.spl_relative:  # unknown, or 0, from which the oracle's SPL does not follow
            return None
        ours += each.n * each.spl
        oracles += each.n * each.spl / each.spl_relative
    return ours / oracles
