"""A table of figures with intervals, and its three forms as text: Markdown, CSV and LaTeX."""

from __future__ import annotations

import csv
import dataclasses
import io
import re

from mazebench.report.results import METRICS

_CSV_COLUMNS = ("table", "metric", "row", "column", "source", "episodes", "value", "low95", "high95", "runs")
_LATEX = {
    **{character: f"\\{character}" for character in "&%$#_{}"},
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "×": r"$\times$",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    "–": "--",
}


@dataclasses.dataclass(frozen=True)
class Cell:
    """A figure; those of the paper come without interval and count."""

    value: float
    low: float | None = None  # of the 95 % interval
    high: float | None = None
    episodes: int | None = None
    runs: int | None = None  # of training, where several are pooled

    def __str__(self) -> str:
        interval = "" if self.low is None else f" [{self.low:.2f}, {self.high:.2f}]"
        return f"{self.value:.2f}{interval}{'' if self.runs is None else f', {self.runs} runs'}"


@dataclasses.dataclass(frozen=True)
class Column:
    """What one agent reached, here or in the paper."""

    label: str
    is_paper: bool
    cells: dict[str, tuple[Cell | None, ...]]  # by metric, one a row


@dataclasses.dataclass(frozen=True)
class Table:
    """Figures of all metrics by row and column."""

    name: str  # of its files
    title: str
    note: str
    row_name: str  # what the rows differ in
    rows: tuple[str, ...]
    x: tuple[float, ...]  # where the first rows lie on an axis; those behind are no points of a curve
    columns: tuple[Column, ...]

    @property
    def metrics(self) -> dict[str, str]:
        """The names of the metrics of which it holds any figure."""
        return {metric: name for metric, name in METRICS.items() if self.columns_of(metric)}

    def columns_of(self, metric: str) -> list[Column]:
        """The columns that hold any figure of a metric."""
        return [column for column in self.columns if any(column.cells[metric])]


def to_markdown(table: Table) -> str:
    """One table a metric, without the title."""
    parts = []
    for metric, name in table.metrics.items():
        columns = table.columns_of(metric)
        head = [f"{name}, by {table.row_name}", *(escape_markdown(column.label) for column in columns)]
        lines = [head, ["---"] * len(head)]
        for index, row in enumerate(table.rows):
            lines.append([row, *(_text(column.cells[metric][index]) for column in columns)])
        parts.append("".join(f"| {' | '.join(line)} |\n" for line in lines))
    return "\n".join(parts)


def to_csv(table: Table) -> str:
    """One figure a line, with the digits that the tables for people leave out."""
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(_CSV_COLUMNS)
    for metric in METRICS:
        for index, row in enumerate(table.rows):
            for column in table.columns_of(metric):
                cell = column.cells[metric][index]
                if cell is not None:
                    source = "paper" if column.is_paper else "measured"
                    figures = [_digits(value) for value in (cell.value, cell.low, cell.high)]
                    writer.writerow([table.name, metric, row, column.label, source, cell.episodes, *figures, cell.runs])
    return file.getvalue()


def to_latex(table: Table) -> str:
    """One `table` environment a metric, no wider than the text; for the packages booktabs and graphicx."""
    parts = []
    for metric, name in table.metrics.items():
        columns = table.columns_of(metric)
        head = [table.row_name, *(column.label for column in columns)]
        body = [
            [row, *(_text(column.cells[metric][index]) for column in columns)] for index, row in enumerate(table.rows)
        ]
        parts.append(
            "\\begin{table}\n\\centering\n"
            f"\\caption{{{escape_latex(f'{table.title}: {name}. {table.note}')}}}\n"
            "\\resizebox{\\ifdim\\width>\\linewidth\\linewidth\\else\\width\\fi}{!}{%\n"
            f"\\begin{{tabular}}{{l{'r' * len(columns)}}}\n\\toprule\n"
            f"{_latex_line(head)}\\midrule\n"
            f"{''.join(map(_latex_line, body))}"
            "\\bottomrule\n\\end{tabular}}\n\\end{table}\n"
        )
    return "\n".join(parts)


def escape_markdown(text: str) -> str:
    """Text that Markdown shows as it is."""
    return re.sub(r"([\\`*_{}\[\]|<>~&$])", r"\\\1", " ".join(text.split()))


def escape_latex(text: str) -> str:
    """Text that LaTeX typesets as it is."""
    return "".join(_LATEX.get(character, character) for character in text)


def _latex_line(texts: list[str]) -> str:
    return " & ".join(map(escape_latex, texts)) + " \\\\\n"


def _text(cell: Cell | None) -> str:
    return "" if cell is None else str(cell)


def _digits(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"
