"""Curves of tables: a value by row, one curve for each agent."""

from __future__ import annotations

import pathlib
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes

from mazebench.report.figures.style import PALETTE, STYLE, WIDTH, finish, new_figure, panel_grid, shorten
from mazebench.report.results import METRICS
from mazebench.report.table import UNTRAINED_MARK, Cell, Column, Table

_MARKERS = "os^DvPX"
_PAPER_MARKERS = "x+1*"
_PAPER_COLOR = "#222222"
_DODGE = 0.12  # of the smallest step between levels, that two agents stand apart


def draw_table(table: Table, labels: Sequence[str], path: pathlib.Path) -> None:
    """Draws success rate and SPL by row, one curve for each agent; SPL by grid distance beside the paper's SPL."""
    with_paper = any(column.is_paper and any(column.cells["spl_grid"]) for column in table.columns)
    metrics = ("success_rate", "spl_grid" if with_paper else "spl")
    with mpl.rc_context(STYLE):
        figure = new_figure(WIDTH, 2.9)
        for index, metric in enumerate(metrics):
            axes = figure.add_subplot(1, 2, index + 1)
            _draw_curves(axes, table, metric, labels)
            axes.set_title(METRICS[metric].capitalize() if metric == "success_rate" else METRICS[metric], loc="left")
        finish(figure, table.title, path)


def draw_table_panels(tables: Sequence[Table], title: str, labels: Sequence[str], path: pathlib.Path) -> None:
    """Draws the success rates of several tables in panels of one scale."""
    with mpl.rc_context(STYLE):
        rows, columns = panel_grid(len(tables))
        figure = new_figure(WIDTH, 2.2 * rows)
        for index, table in enumerate(tables):
            axes = figure.add_subplot(rows, columns, index + 1)
            _draw_curves(axes, table, "success_rate", labels)
            axes.set_title(table.title.rpartition(", ")[2], loc="left")
            axes.set_ylabel("success rate" if index % columns == 0 else "")
        finish(figure, title, path)


def _draw_curves(axes: Axes, table: Table, metric: str, labels: Sequence[str]) -> None:
    x = np.array(table.x)
    is_curve = table.row_name == "distance"
    ours = [column for column in table.columns_of(metric) if not column.is_paper]
    step = np.diff(x).min() if len(x) > 1 else 1.0
    for index, column in enumerate(ours):
        shift = 0.0 if is_curve else (index - (len(ours) - 1) / 2) * _DODGE * step
        place = labels.index(column.label)
        _draw_curve(axes, x + shift, column.cells[metric][: len(x)], column.label, place, is_curve)
    for index, column in enumerate(column for column in table.columns_of(metric) if column.is_paper):
        points = [(at, cell.value) for at, cell in zip(x, column.cells[metric], strict=False) if cell]
        axes.plot(
            *np.array(points).T,
            linestyle=":",
            linewidth=0.9,
            color=_paper_color(column, labels),
            marker=_PAPER_MARKERS[index % len(_PAPER_MARKERS)],
            markersize=5.5,
            label=column.label,
            zorder=4,
        )
    axes.set_ylim(-0.05, 1.05)
    axes.set_xlabel(f"{table.row_name}{' (cells)' if 'distance' in table.row_name else ''}")
    if not is_curve:
        axes.set_xlim(x[0] - step / 2, x[-1] + step / 2)
    if not is_curve or len(x) <= 5:
        every = 1 if len(x) <= 8 else 2
        axes.set_xticks(x[::every], table.rows[: len(x) : every])


def _paper_color(column: Column, labels: Sequence[str]) -> str:
    """Returns the colour of the agent with the same name as the paper's agent."""
    namesake = column.label.partition(" ")[0].lower()
    return PALETTE[labels.index(namesake) % len(PALETTE)] if namesake in labels else _PAPER_COLOR


def _draw_curve(
    axes: Axes, x: np.ndarray, cells: Sequence[Cell | None], label: str, place: int, is_curve: bool
) -> None:
    """Draws a line with a band for a curve over distances, else points with bars.

    The later an agent is drawn, the finer its line: where two agree, both are seen.
    """
    there = [index for index, cell in enumerate(cells) if cell]
    value, low, high = np.array([(cell.value, cell.low, cell.high) for cell in cells if cell]).T
    rank = place % len(PALETTE)
    color, marker = PALETTE[rank], _MARKERS[(place + place // len(PALETTE)) % len(_MARKERS)]
    style: dict[str, Any] = {"color": color, "marker": marker, "label": shorten(label)}
    style |= {"markersize": 4.8 - 0.35 * rank, "linewidth": 1.8 - 0.15 * rank}
    for at, cell in zip(x, cells, strict=True):
        if cell and cell.is_untrained_scale:
            axes.annotate(UNTRAINED_MARK, (at, cell.value), (3, 1), textcoords="offset points")
    if is_curve:
        axes.fill_between(x[there], low, high, color=color, alpha=0.16, linewidth=0)
        axes.plot(x[there], value, **style)
    else:
        errors = [np.maximum(value - low, 0), np.maximum(high - value, 0)]
        axes.errorbar(x[there], value, yerr=errors, elinewidth=0.9, capsize=1.5, alpha=0.95, **style)
