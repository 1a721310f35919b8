"""Tables of measured and printed values with their intervals, and their forms as text."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterable, Mapping
from typing import Any

import pandas as pd

from mazebench.results.metrics import METRICS

# Of `Table.values`; `column` is an agent, `source` is "measured" or "paper", `runs` are training runs of a mean over
# several, `mark` is "*" if the agent learned, but never on maps of this scale.
COLUMNS = ["metric", "row", "column", "source", "episodes", "value", "low95", "high95", "runs", "mark"]


@dataclasses.dataclass(frozen=True)
class Table:
    """Values of all metrics by row and column."""

    name: str  # of its files
    title: str
    note: str
    row_name: str  # of what the rows differ in
    values: pd.DataFrame  # a line for each value with `COLUMNS`; `row` and `column` are ordered categories

    @property
    def metrics(self) -> list[str]:
        """The metrics of which there are values."""
        return [metric for metric in METRICS if (self.values.metric == metric).any()]

    @property
    def x(self) -> dict[str, float]:
        """The places on an axis of the rows that are called after numbers."""
        return {row: float(row) for row in self.values.row.cat.categories if re.fullmatch(r"[\d.]+", row)}

    def wide(self, metric: str) -> pd.DataFrame:
        """Returns a metric's values with their intervals as texts, by row and column; the columns' name says both."""
        values = self.values[self.values.metric == metric]
        texts = pd.Series([_format(**value) for value in values.to_dict("records")], [values.row, values.column])
        columns = values.column.cat.remove_unused_categories().cat.categories
        wide = texts.unstack(fill_value="").reindex(values.row.cat.categories, columns=columns, fill_value="")
        return wide.rename_axis(index=None, columns=f"{METRICS[metric].title}, by {self.row_name}")

    def to_files(self) -> dict[str, str]:
        """Returns the table by the suffix of a file; the CSV has a line for each value, with more digits."""
        wide = [self.wide(metric) for metric in self.metrics]
        return {
            ".md": "\n".join(map(to_markdown, wide)),
            ".csv": _without_formulas(self.values).to_csv(index=False, float_format="%.6g"),
            ".tex": "\n".join(each.to_latex(escape=True) for each in wide),
        }


def make_values(lines: Iterable[Mapping[str, Any]], rows: Iterable[str]) -> pd.DataFrame:
    """Returns the `Table.values` of lines, in the order of `rows` and of the columns in them."""
    values = pd.DataFrame(lines, columns=COLUMNS)
    values["row"] = pd.Categorical(values.row, list(rows), ordered=True)
    values["column"] = pd.Categorical(values.column, values.column.unique(), ordered=True)
    values["mark"] = values["mark"].astype(object).fillna("")
    values[["episodes", "runs"]] = values[["episodes", "runs"]].astype("Int64")
    return values.sort_values(["metric", "row", "column"], kind="stable", ignore_index=True)


def to_markdown(frame: pd.DataFrame) -> str:
    """Returns a frame of texts as a table in Markdown; names of rows and columns are escaped."""
    head = [escape_markdown(str(name)) for name in (frame.columns.name or "", *frame.columns)]
    rows = ([escape_markdown(str(row)), *map(str, cells)] for row, *cells in frame.itertuples())
    return "".join(f"| {' | '.join(line)} |\n" for line in (head, ["---"] * len(head), *rows))


def escape_markdown(text: str) -> str:
    """Returns the Markdown that shows `text` as it is."""
    return re.sub(r"([\\`*_{}\[\]|<>~&$])", r"\\\1", " ".join(text.split()))


def _without_formulas(values: pd.DataFrame) -> pd.DataFrame:
    """Returns values whose names no spreadsheet takes for formulas: a quote stands before them."""
    names = {name: values[name].astype(str).str.replace(r"^(?=[=+@-])", "'", regex=True) for name in ("row", "column")}
    return values.assign(**names)


def _format(value: float, low95: float, high95: float, runs: Any, mark: str, **_: Any) -> str:
    """Returns a value with its interval, as "0.50 [0.25, 0.75]"."""
    interval = "" if pd.isna(low95) else f" [{low95:.2f}, {high95:.2f}]"
    return f"{value:.2f}{mark}{interval}{'' if pd.isna(runs) else f', {runs} runs'}"
