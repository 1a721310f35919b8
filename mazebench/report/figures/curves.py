"""Curves of tables: a value by row, one curve for each agent."""

from __future__ import annotations

import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes

from mazebench.report.figures.style import NAME_CHARACTERS, STYLE, UNTRAINED_KEY, WIDTH, finish, new_figure, panel_grid
from mazebench.report.looks import PALETTE, PAPER_COLOR, PAPER_MARKERS, Look, wrap
from mazebench.report.results import METRICS
from mazebench.report.table import UNTRAINED_MARK, Cell, Table

_DODGE, _DODGES = 0.12, 0.72  # of the smallest step between levels: two agents are so far apart, all of them at most
_MIN_CURVE = 4  # points of a curve with bands; fewer have bars, since bands over one point are not seen
_BAND, _BANDS = 0.16, 0.9  # opacity of a band, and of all bands together at most


def draw_table(table: Table, looks: Mapping[str, Look], path: pathlib.Path) -> None:
    """Draws success rate and SPL by row, one curve for each agent; SPL by grid distance beside the paper's SPL."""
    with_paper = any(column.is_paper and any(column.cells["spl_grid"]) for column in table.columns)
    metrics = ("success_rate", "spl_grid" if with_paper else "spl")
    with mpl.rc_context(STYLE):
        figure = new_figure(WIDTH, 2.65)
        for index, metric in enumerate(metrics):
            axes = figure.add_subplot(1, 2, index + 1)
            draw_curves(axes, table, metric, looks)
            axes.set_title(METRICS[metric].capitalize() if metric == "success_rate" else METRICS[metric], loc="left")
        finish(figure, table.title, path)


def draw_table_panels(tables: Sequence[Table], title: str, looks: Mapping[str, Look], path: pathlib.Path) -> None:
    """Draws the success rates of several tables in panels of one scale."""
    with mpl.rc_context(STYLE):
        rows, columns = panel_grid(len(tables))
        figure = new_figure(WIDTH, 0.2 + 2.0 * rows)
        for index, table in enumerate(tables):
            axes = figure.add_subplot(rows, columns, index + 1)
            draw_curves(axes, table, "success_rate", looks)
            axes.set_title(table.title.rpartition(", ")[2], loc="left")
            axes.set_ylabel("success rate" if index % columns == 0 else "")
        finish(figure, title, path)


def draw_curves(axes: Axes, table: Table, metric: str, looks: Mapping[str, Look]) -> None:
    """Draws a metric by row: curves with bands, or few points with bars, beside one another for each agent."""
    x = np.array(table.x)
    is_curve = table.row_name == "distance" and len(x) >= _MIN_CURVE
    ours = [column for column in table.columns_of(metric) if not column.is_paper]
    step = np.diff(x).min() if len(x) > 1 else 1.0
    dodge = min(_DODGE, _DODGES / max(len(ours), 1)) * step
    band = min(_BAND, _BANDS / max(len(ours), 1)) if is_curve else None
    for index, column in enumerate(ours):
        shift = 0.0 if is_curve else (index - (len(ours) - 1) / 2) * dodge
        _draw_curve(axes, x + shift, column.cells[metric][: len(x)], looks[column.label], band)
    for column in (column for column in table.columns_of(metric) if column.is_paper):
        points = [(at, cell.value) for at, cell in zip(x, column.cells[metric], strict=False) if cell]
        axes.plot(
            *np.array(points).T,
            linestyle=":",
            linewidth=0.9,
            color=PAPER_COLOR,
            marker=PAPER_MARKERS[column.label],
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


def _draw_curve(axes: Axes, x: np.ndarray, cells: Sequence[Cell | None], look: Look, band: float | None) -> None:
    """Draws a line with a `band` of that opacity, or without one points with bars.

    The later an agent is drawn, the finer its line: where two agree, both are seen.
    """
    there = [index for index, cell in enumerate(cells) if cell]
    value, low, high = np.array([(cell.value, cell.low, cell.high) for cell in cells if cell]).T
    rank = look.place % len(PALETTE)
    style: dict[str, Any] = {"color": look.color, "marker": look.marker, "linestyle": look.dashes}
    style |= {"markersize": 4.8 - 0.35 * rank, "linewidth": 1.8 - 0.15 * rank}
    style |= {"label": wrap(look.name, NAME_CHARACTERS)}
    for at, cell in zip(x, cells, strict=True):
        if cell and cell.is_untrained_scale:
            axes.annotate(UNTRAINED_MARK, (at, cell.value), (3, 1), textcoords="offset points")
            axes.plot([], [], linestyle="", marker=(6, 2, 0), markersize=5, color="black", label=UNTRAINED_KEY)
    if band is not None:
        axes.fill_between(x[there], low, high, color=look.color, alpha=band, linewidth=0)
        axes.plot(x[there], value, **style)
    else:
        errors = [np.maximum(value - low, 0), np.maximum(high - value, 0)]
        axes.errorbar(x[there], value, yerr=errors, elinewidth=0.9, capsize=1.5, alpha=0.95, **style)
