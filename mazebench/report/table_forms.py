"""The forms of a table as text: Markdown, CSV and LaTeX."""

from __future__ import annotations

import csv
import io
import re

from mazebench.report.table import METRIC_NAMES, UNTRAINED_MARK, Cell, Table

_CSV_COLUMNS = ("table", "metric", "row", "column", "source", "episodes", "value", "low95", "high95", "runs", "mark")
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


def to_markdown(table: Table) -> str:
    """Returns a table for each metric, without the title."""
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
    """Returns a line for each value, with more digits than the other forms."""
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(_CSV_COLUMNS)
    for metric in METRIC_NAMES:
        for index, row in enumerate(table.rows):
            for column in table.columns_of(metric):
                cell = column.cells[metric][index]
                if cell is not None:
                    source = "paper" if column.is_paper else "measured"
                    figures = [_digits(value) for value in (cell.value, cell.low, cell.high)]
                    mark = UNTRAINED_MARK if cell.is_untrained_scale else ""
                    values = [cell.episodes, *figures, cell.runs, mark]
                    writer.writerow([table.name, metric, row, column.label, source, *values])
    return file.getvalue()


def to_latex(table: Table) -> str:
    """Returns a `table` environment for each metric, no wider than the text; it needs booktabs and graphicx."""
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
    """Returns the Markdown that shows `text` as it is."""
    return re.sub(r"([\\`*_{}\[\]|<>~&$])", r"\\\1", " ".join(text.split()))


def escape_latex(text: str) -> str:
    """Returns the LaTeX that typesets `text` as it is."""
    return "".join(_LATEX.get(character, character) for character in text)


def _latex_line(texts: list[str]) -> str:
    return " & ".join(map(escape_latex, texts)) + " \\\\\n"


def _text(cell: Cell | None) -> str:
    return "" if cell is None else str(cell)


def _digits(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"
