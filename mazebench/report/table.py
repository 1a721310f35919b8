"""Tables of measured and printed values, with their intervals."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from mazebench.report.results import METRICS

SPL_RELATIVE = "spl_relative"
_WIDE = 240  # characters
_CELL = len("0.50 [0.25, 0.75]")
METRIC_NAMES = METRICS | {SPL_RELATIVE: "SPL / oracle's"}
UNTRAINED_MARK = "*"
UNTRAINED_NOTE = f"{UNTRAINED_MARK} The agent was never trained on maps of this scale."


@dataclasses.dataclass(frozen=True)
class Cell:
    """A value; those of the paper come without interval and count."""

    value: float
    low: float | None = None  # of the 95 % interval
    high: float | None = None
    episodes: int | None = None
    runs: int | None = None  # of training, where several are pooled
    is_untrained_scale: bool = False  # whether the agent learned, but never on maps of this scale

    def __str__(self) -> str:
        mark = UNTRAINED_MARK if self.is_untrained_scale else ""
        interval = "" if self.low is None else f" [{self.low:.2f}, {self.high:.2f}]"
        return f"{self.value:.2f}{mark}{interval}{'' if self.runs is None else f', {self.runs} runs'}"


@dataclasses.dataclass(frozen=True)
class Column:
    """The values of one agent, measured or printed in the paper."""

    label: str
    is_paper: bool
    cells: dict[str, tuple[Cell | None, ...]]  # by metric, one for each row


@dataclasses.dataclass(frozen=True)
class Table:
    """Values of all metrics by row and column."""

    name: str  # of its files
    title: str
    note: str
    row_name: str  # of what the rows differ in
    rows: tuple[str, ...]
    x: tuple[float, ...]  # where the first rows lie on an axis; the rows behind are no points of a curve
    columns: tuple[Column, ...]

    @property
    def metrics(self) -> dict[str, str]:
        """The metrics that the table has values of, with their names."""
        return {metric: name for metric, name in METRIC_NAMES.items() if self.columns_of(metric)}

    @property
    def is_turned(self) -> bool:
        """Whether columns are shown as rows: where a table is wide and narrower that way, as with long names."""
        labels = [column.label for column in self.columns]
        return _width(labels, self.rows) < _width(self.rows, labels) > _WIDE

    def columns_of(self, metric: str) -> list[Column]:
        """Returns the columns that have a value of a metric."""
        return [column for column in self.columns if any(column.cells.get(metric, ()))]


def _width(rows: Sequence[str], columns: Sequence[str]) -> int:
    """Returns the characters in a line of a table with such names of rows and columns."""
    return max(map(len, rows)) + sum(max(len(name), _CELL) for name in columns)
