"""The forms of a table as text: Markdown, CSV and LaTeX."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence

from mazebench.errors import one_line
from mazebench.report.looks import wrap
from mazebench.report.table import METRIC_NAMES, UNTRAINED_MARK, Cell, Column, Table

_CSV_COLUMNS = ("table", "metric", "row", "column", "source", "episodes", "value", "low95", "high95", "runs", "mark")
# What a spreadsheet would take for a formula; OWASP's remedy is an apostrophe in front.
_FORMULA = re.compile(r"[=@\t\r\n]|[+-](?![\d.]+$)")
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


def to_markdown(table: Table) -> str:
    """Returns a table for each metric, without the title."""
    parts = []
    for metric, name in table.metrics.items():
        columns = table.columns_of(metric)
        lines = [(f"{name}, by {table.row_name}", *(escape_markdown(column.label) for column in columns))]
        for index, row in enumerate(table.rows):
            lines.append((row, *(_text(column.cells[metric][index]) for column in columns)))
        if table.is_turned:
            lines = list(zip(*lines, strict=True))
        lines.insert(1, ("---",) * len(lines[0]))
        parts.append("".join(f"| {' | '.join(line)} |\n" for line in lines))
    return "\n".join(parts)


def to_csv(table: Table) -> str:
    """Returns a line for each value, with more digits than the other forms; no name is a formula of a spreadsheet."""
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
                    names = [table.name, metric, _no_formula(row), _no_formula(column.label)]
                    writer.writerow([*names, source, *values])
    return file.getvalue()


def to_latex(table: Table, metric: str) -> str:
    """Returns a `table` environment of one metric, no wider than the text; it needs booktabs and graphicx.

    Many columns stand in several blocks below one another.
    """
    columns = table.columns_of(metric)
    num_blocks = -(-len(columns) // _LATEX_COLUMNS)
    blocks = (columns[len(columns) * n // num_blocks : len(columns) * (n + 1) // num_blocks] for n in range(num_blocks))
    caption = f"{table.title}: {METRIC_NAMES[metric]}. {table.note}".strip()
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


def _no_formula(text: str) -> str:
    """Returns a text in one line that a spreadsheet shows as it is."""
    return f"'{one_line(text)}" if _FORMULA.match(text) else one_line(text)


def _text(cell: Cell | None) -> str:
    return "" if cell is None else str(cell)


def _digits(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"
