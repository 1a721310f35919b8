"""Tables of measured and printed values with their intervals, and their forms as text: Markdown, CSV and LaTeX."""

from __future__ import annotations

import csv
import dataclasses
import io
import re
from collections.abc import Callable, Sequence

from mazebench.errors import one_line
from mazebench.report.looks import wrap
from mazebench.results.metrics import ON_TIME_METRICS

METRICS = {  # of each episode, with their names
    "success_rate": "success rate",
    **{metric: f"on time ({factor:g})" for metric, factor in ON_TIME_METRICS.items()},
    "spl": "SPL",
    "spl_grid": "SPL by grid distance",
}
UNTRAINED_MARK = "*"
UNTRAINED_NOTE = f"{UNTRAINED_MARK} The agent was never trained on maps of this scale."

_WIDE = 240  # characters
_CELL = len("0.50 [0.25, 0.75]")
_CSV_COLUMNS = ("table", "metric", "row", "column", "source", "episodes", "value", "low95", "high95", "runs", "mark")
# Of a table in LaTeX, with as many columns of numbers beside one another, and as many characters in a line of text.
_LATEX_COLUMNS, _LATEX_HEAD, _LATEX_ROW = 6, 18, 30
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
        return {metric: name for metric, name in METRICS.items() if self.columns_of(metric)}

    @property
    def is_turned(self) -> bool:
        """Whether columns are shown as rows: where a table is wide and narrower that way, as with long names."""
        labels = [column.label for column in self.columns]
        return _width(labels, self.rows) < _width(self.rows, labels) > _WIDE

    def columns_of(self, metric: str) -> list[Column]:
        """Returns the columns that have a value of a metric."""
        return [column for column in self.columns if any(column.cells.get(metric, ()))]

    def lines(self, metric: str, escape: Callable[[str], str] = str) -> list[list[str]]:
        """Returns the texts of the table of a metric line by line, the head first; labels are escaped."""
        columns = self.columns_of(metric)
        lines = [[f"{METRICS[metric]}, by {self.row_name}", *(escape(column.label) for column in columns)]]
        for index, row in enumerate(self.rows):
            lines.append([row, *(_text(column.cells[metric][index]) for column in columns)])
        return [list(line) for line in zip(*lines, strict=True)] if self.is_turned else lines


def to_markdown(table: Table) -> str:
    """Returns a table for each metric, without the title."""
    parts = []
    for metric in table.metrics:
        head, *body = table.lines(metric, escape_markdown)
        lines = [head, ["---"] * len(head), *body]
        parts.append("".join(f"| {' | '.join(line)} |\n" for line in lines))
    return "\n".join(parts)


def to_csv(table: Table) -> str:
    """Returns a line for each value, with more digits than the other forms."""
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
                    mark = UNTRAINED_MARK if cell.is_untrained_scale else ""
                    values = [cell.episodes, *figures, cell.runs, mark]
                    names = [table.name, metric, one_line(row), one_line(column.label)]
                    writer.writerow([*names, source, *values])
    return file.getvalue()


def to_latex(table: Table, metric: str) -> str:
    """Returns a `table` environment of one metric, no wider than the text; it needs booktabs and graphicx.

    Many columns stand in several blocks below one another.
    """
    columns = table.columns_of(metric)
    num_blocks = -(-len(columns) // _LATEX_COLUMNS)
    blocks = (columns[len(columns) * n // num_blocks : len(columns) * (n + 1) // num_blocks] for n in range(num_blocks))
    caption = f"{table.title}: {METRICS[metric]}. {table.note}".strip()
    if any(cell and cell.low is not None for column in columns for cell in column.cells[metric]):
        caption += " The brackets are 95 % intervals."
    return (
        f"\\begin{{table}}\n\\centering\n\\caption{{{escape_latex(caption)}}}\n"
        f"\\label{{tab:{latex_name(table, metric)}}}\n"
        + "\\par\\medskip\n".join(_latex_block(table, metric, block) for block in blocks)
        + "\\end{table}\n"
    )


def latex_name(table: Table, metric: str) -> str:
    """Returns the name of the file of one metric, which is also its label."""
    return f"{table.name}-{metric}".replace("_", "-")


def escape_markdown(text: str) -> str:
    """Returns the Markdown that shows `text` as it is."""
    return re.sub(r"([\\`*_{}\[\]|<>~&$])", r"\\\1", " ".join(text.split()))


def escape_latex(text: str) -> str:
    """Returns the LaTeX that typesets `text` as it is."""
    return "".join(_LATEX.get(character, character) for character in text)


def _latex_block(table: Table, metric: str, columns: Sequence[Column]) -> str:
    lines = [
        [_latex_lines(table.row_name, _LATEX_ROW, "l"), *(_latex_lines(c.label, _LATEX_HEAD, "r") for c in columns)]
    ]
    for index, row in enumerate(table.rows):
        lines.append([_latex_lines(row, _LATEX_ROW, "l"), *(_text(column.cells[metric][index]) for column in columns)])
    head, *body = (" & ".join(line) + " \\\\\n" for line in lines)
    return (
        "\\resizebox{\\ifdim\\width>\\linewidth\\linewidth\\else\\width\\fi}{!}{%\n"
        f"\\begin{{tabular}}{{l{'r' * len(columns)}}}\n\\toprule\n"
        f"{head}\\midrule\n{''.join(body)}\\bottomrule\n\\end{{tabular}}}}\n"
    )


def _latex_lines(text: str, width: int, side: str) -> str:
    """Returns the LaTeX of a cell: a text that is longer than `width` as lines one below the other."""
    lines = [escape_latex(line) for line in wrap(text, width).split("\n")]
    stacked = " \\\\{} ".join(lines)  # without the braces, a line that begins with [ would be an option
    return lines[0] if len(lines) == 1 else f"\\begin{{tabular}}[b]{{@{{}}{side}@{{}}}}{stacked}\\end{{tabular}}"


def _text(cell: Cell | None) -> str:
    return "" if cell is None else str(cell)


def _digits(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"


def _width(rows: Sequence[str], columns: Sequence[str]) -> int:
    """Returns the characters in a line of a table with such names of rows and columns."""
    return max(map(len, rows)) + sum(max(len(name), _CELL) for name in columns)
