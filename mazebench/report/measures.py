"""Tables filled with the metrics of the episodes of each row and agent, and with what the paper printed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import pandas as pd

from mazebench.report.frame import Rows
from mazebench.report.table import METRICS, UNTRAINED_NOTE, Cell, Column, Table
from mazebench.results.intervals import mean_interval
from mazebench.results.paper import printed


def make_table(
    name: str,
    title: str,
    note: str,
    row_name: str,
    rows: Rows,
    x: Sequence[float] = (),
    paper: Sequence[Column] = (),
) -> Table:
    """Returns a table with a column for each agent that has episodes in a row, and the paper's columns behind them."""
    found = {
        row: {label: measure(own) for label, own in episodes.groupby("label", observed=True)}
        for row, episodes in rows.items()
    }
    cells = [cell for by_label in found.values() for by_metric in by_label.values() for cell in by_metric.values()]
    if any(cell.is_untrained_scale for cell in cells):
        note = f"{note} {UNTRAINED_NOTE}".strip()
    columns = [
        Column(label, False, {metric: _of_column(found, label, metric) for metric in METRICS})
        for label in _labels(rows)
    ]
    return Table(name, title, note, row_name, tuple(rows), tuple(x), (*columns, *paper))


def measure(episodes: pd.DataFrame) -> dict[str, Cell]:
    """Returns the metrics that are known of episodes of one result, at least one, with 95 % intervals."""
    marked: dict[str, Any] = {"is_untrained_scale": episodes.result.iloc[0].summary.untrained_scale}
    cells = {}
    for metric in METRICS:
        if episodes[metric].isna().any():  # the oracle's steps are not known
            continue
        estimate = mean_interval(episodes[metric].to_numpy(), episodes.maze_index.to_numpy())
        cells[metric] = Cell(estimate.value, estimate.low, estimate.high, len(episodes), **marked)
    return cells


def paper_columns(task: str, size: int, rows: Sequence[float], num_rows: int, warped: bool = False) -> list[Column]:
    """Returns a column for each agent for which the paper prints any of `rows`.

    Args:
      task: the task.
      size: cells a side.
      rows: distances or landmark distances in cells, of the first rows of the table.
      num_rows: all rows of the table.
      warped: whether the maps were warped.
    """
    columns = []
    nothing: tuple[Cell | None, ...] = (None,) * num_rows
    for agent, metrics in printed(task, size, warped).items():
        cells = dict.fromkeys(METRICS, nothing)
        for metric, values in metrics.items():
            there = tuple(Cell(values[int(row)]) if row in values else None for row in rows)
            cells[metric] = there + nothing[len(there) :]
        if any(map(any, cells.values())):
            columns.append(Column(f"{agent} (paper)", True, cells))
    return columns


def _labels(rows: Rows) -> list[str]:
    """Returns the labels of all agents that have episodes in a row, in the order of the report."""
    label = pd.concat([episodes.label for episodes in rows.values()])
    return label.cat.remove_unused_categories().cat.categories.tolist()


def _of_column(found: dict[str, dict[str, dict[str, Cell]]], label: str, metric: str) -> tuple[Cell | None, ...]:
    return tuple(by_label.get(label, {}).get(metric) for by_label in found.values())
