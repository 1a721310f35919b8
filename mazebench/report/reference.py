"""What the paper printed, to stand beside our own figures."""

from __future__ import annotations

import functools
import json
from collections.abc import Sequence
from importlib import resources
from typing import Any

from mazebench.report.results import METRICS
from mazebench.report.table import Cell, Column


@functools.cache
def reference() -> dict[str, Any]:
    """The paper's title, authors and tables."""
    return json.loads(resources.files("mazebench_assets").joinpath("paper", "reference.json").read_text("utf-8"))


def citation() -> str:
    """The paper in one line."""
    return f"{reference()['authors']}, {reference()['title']}"


def paper_columns(task: str, size: int, rows: Sequence[float], num_rows: int, warped: bool = False) -> list[Column]:
    """A column for each agent of which the paper prints any of `rows` (distances, or landmark distances).

    Args:
      task: the task.
      size: cells a side.
      rows: of the table that the columns are for, in cells.
      num_rows: with rows that the paper has not, behind `rows`.
      warped: whether the maps were warped.
    """
    cells: dict[str, dict[str, list[Cell | None]]] = {}
    for table in reference()["tables"]:
        if (table["task"], table["size"], table["warped"]) != (task, size, warped):
            continue
        for agent, values in table["agents"].items():
            printed = dict(zip(table["rows"], values, strict=True))
            column = [Cell(printed[row]) if row in printed else None for row in rows]
            if any(column):
                cells.setdefault(agent, {})[table["metric"]] = column + [None] * (num_rows - len(column))
    nothing: tuple[Cell | None, ...] = (None,) * num_rows
    return [
        Column(f"{agent} (paper)", True, {metric: tuple(columns.get(metric, nothing)) for metric in METRICS})
        for agent, columns in cells.items()
    ]
