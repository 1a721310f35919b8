"""The values that the paper printed, as columns of tables."""

from __future__ import annotations

from collections.abc import Sequence

from mazebench.report.results import METRICS
from mazebench.report.table import Cell, Column
from mazebench.results.paper import printed


def paper_columns(task: str, size: int, rows: Sequence[float], num_rows: int, warped: bool = False) -> list[Column]:
    """Returns a column for each agent for which the paper prints any of `rows`.

    Args:
      task: the task.
      size: cells a side.
      rows: distances or landmark distances in cells, of the first rows of the table.
      num_rows: all rows of the table.
      warped: whether the maps were warped.
    """
    cells: dict[str, dict[str, list[Cell | None]]] = {}
    for agent, metrics in printed(task, size, warped).items():
        for metric, values in metrics.items():
            column = [Cell(values[int(row)]) if row in values else None for row in rows]
            if any(column):
                cells.setdefault(agent, {})[metric] = column + [None] * (num_rows - len(column))
    nothing: tuple[Cell | None, ...] = (None,) * num_rows
    return [
        Column(f"{agent} (paper)", True, {metric: tuple(columns.get(metric, nothing)) for metric in METRICS})
        for agent, columns in cells.items()
    ]
