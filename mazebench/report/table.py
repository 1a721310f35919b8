"""Tables of measured and printed values with their intervals, and their forms as text: Markdown, CSV, LaTeX, HTML."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterable, Mapping
from typing import Any

import pandas as pd

from mazebench.errors import one_line
from mazebench.results.metrics import ON_TIME_METRICS

METRICS = {  # of each episode, with their names
    "success_rate": "success rate",
    **{metric: f"on time ({factor:g})" for metric, factor in ON_TIME_METRICS.items()},
    "spl": "SPL",
    "spl_grid": "SPL by grid distance",
}
UNTRAINED_NOTE = "* The agent was never trained on maps of this scale."
# Of `Table.values`; `column` is an agent, `source` is "measured" or "paper", `runs` are training runs that are pooled,
# `mark` is "*" if the agent learned, but never on maps of this scale.
COLUMNS = ["metric", "row", "column", "source", "episodes", "value", "low95", "high95", "runs", "mark"]

# As wide as it is, but no wider than the text.
_RESIZED = r"\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}{%"


@dataclasses.dataclass(frozen=True)
class Table:
    """Values of all metrics by row and column."""

    name: str  # of its files
    title: str
    note: str
    row_name: str  # of what the rows differ in
    values: pd.DataFrame  # a line for each value with `COLUMNS`; `row` and `column` are ordered categories
    x: Mapping[str, float] = dataclasses.field(default_factory=dict)  # where rows lie on an axis

    @property
    def metrics(self) -> list[str]:
        """The metrics of which there are values."""
        return [metric for metric in METRICS if (self.values.metric == metric).any()]

    def wide(self, metric: str) -> pd.DataFrame:
        """Returns a metric's values with their intervals as texts, by row and column."""
        values = self.values[self.values.metric == metric]
        texts = pd.Series([format_value(**value) for value in values.to_dict("records")], [values.row, values.column])
        wide = texts.unstack(fill_value="").reindex(values.row.cat.categories, fill_value="")
        return wide.rename_axis(f"{METRICS[metric]}, by {self.row_name}").rename_axis(None, axis=1)


def make_values(lines: Iterable[Mapping[str, Any]], rows: Iterable[str], columns: Iterable[str]) -> pd.DataFrame:
    """Returns the `Table.values` of lines, in the order of rows and columns."""
    values = pd.DataFrame(lines, columns=COLUMNS)
    values["row"] = pd.Categorical(values.row, list(rows), ordered=True)
    values["column"] = pd.Categorical(values.column, list(columns), ordered=True)
    values["mark"] = values["mark"].astype(object).fillna("")
    values[["episodes", "runs"]] = values[["episodes", "runs"]].astype("Int64")
    return values.sort_values(["metric", "row", "column"], kind="stable", ignore_index=True)


def format_value(value: float, low95: float, high95: float, runs: Any, mark: str, **_: Any) -> str:
    """Returns a value with its interval, as "0.50 [0.25, 0.75]"."""
    interval = "" if pd.isna(low95) else f" [{low95:.2f}, {high95:.2f}]"
    return f"{value:.2f}{mark}{interval}{'' if pd.isna(runs) else f', {runs} runs'}"


def to_markdown(frame: pd.DataFrame) -> str:
    """Returns a frame of texts as a table in Markdown; names of rows and columns are escaped."""
    head = [escape_markdown(str(name)) for name in (frame.index.name or "", *frame.columns)]
    rows = ([escape_markdown(str(row)), *map(str, cells)] for row, *cells in frame.itertuples())
    return "".join(f"| {' | '.join(line)} |\n" for line in (head, ["---"] * len(head), *rows))


def to_csv(table: Table) -> str:
    """Returns a line for each value, with more digits than the other forms."""
    values = table.values.assign(row=table.values.row.map(one_line), column=table.values.column.map(one_line))
    values.insert(0, "table", table.name)
    return values.to_csv(index=False, float_format="%.6g", lineterminator="\n")


def to_latex(table: Table, metric: str) -> str:
    """Returns a `table` environment of one metric, no wider than the text; it needs booktabs and graphicx."""
    caption = f"{table.title}: {METRICS[metric]}. {table.note}".strip() + " Brackets are 95 % intervals."
    caption = re.sub(r"([&%$#_{}])", r"\\\1", caption)
    wide = table.wide(metric)
    wide = wide.rename_axis(index=None, columns=wide.index.name)  # in one line with the names of columns
    style = wide.style.format(escape="latex").format_index(escape="latex").format_index(escape="latex", axis=1)
    latex = style.to_latex(
        caption=caption,
        label=f"tab:{latex_name(table, metric)}",
        column_format="l" + "r" * len(wide.columns),
        hrules=True,
        position_float="centering",
    )
    return latex.replace(r"\begin{tabular}", f"{_RESIZED}\n\\begin{{tabular}}").replace(
        r"\end{tabular}", r"\end{tabular}}"
    )


def latex_name(table: Table, metric: str) -> str:
    """Returns the name of the file of one metric, which is also its label."""
    return f"{table.name}-{metric}".replace("_", "-")


def escape_markdown(text: str) -> str:
    """Returns the Markdown that shows `text` as it is."""
    return re.sub(r"([\\`*_{}\[\]|<>~&$])", r"\\\1", " ".join(text.split()))
