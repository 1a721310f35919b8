"""Violins: the spread of SPL over episodes at each level of a perturbation."""

from __future__ import annotations

import pathlib
from collections.abc import Mapping, Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from mazebench.report.distributions import GRID, Distribution, Violin
from mazebench.report.figures.style import LINE, STYLE, WIDTH, finish, new_figure, panel_grid, wrap_title
from mazebench.report.looks import Look

_Y_AXIS = 0.5  # inches, of a panel's width


def draw_distribution(distribution: Distribution, looks: Mapping[str, Look], path: pathlib.Path) -> None:
    """Draws a panel for each agent, with a violin for each level and the mean with its interval in it."""
    with mpl.rc_context(STYLE):
        rows, columns = panel_grid(len(distribution.panels))
        width = WIDTH if columns > 1 else WIDTH / 1.6
        names = {label: wrap_title(looks[label].name, width / columns - _Y_AXIS) for label, _ in distribution.panels}
        lines = max(name.count("\n") for name in names.values())
        figure = new_figure(width, 0.2 + (2.1 + LINE * lines) * rows)
        for index, (label, violins) in enumerate(distribution.panels):
            axes = figure.add_subplot(rows, columns, index + 1)
            _draw_violins(axes, violins, looks[label].color)
            every = 1 if len(distribution.levels) <= 6 else 2
            places = range(0, len(distribution.levels), every)
            axes.set_xticks(places, [f"{distribution.levels[place]:g}" for place in places])
            axes.set_xlabel(distribution.level_name)
            axes.set_ylabel("SPL" if index % columns == 0 else "")
            axes.set_title(names[label], loc="left")
        mean = Line2D([], [], color="black", marker="o", markersize=3, label="mean, 95 % interval")
        finish(figure, distribution.title, path, [mean])


def _draw_violins(axes: Axes, violins: Sequence[Violin | None], color: str) -> None:
    for position, violin in enumerate(violins):
        if violin is None:
            continue
        # All violins have the same width at their peaks; densities below a thousandth of it are not drawn.
        half = np.where(violin.density > 1e-3, 0.42 * violin.density, np.nan)
        axes.fill_betweenx(GRID, position - half, position + half, color=color, alpha=0.35, linewidth=0)
        axes.plot(position - half, GRID, color=color, linewidth=0.7)
        axes.plot(position + half, GRID, color=color, linewidth=0.7)
        mean = violin.mean
        axes.plot([position] * 2, [mean.low, mean.high], color="black", linewidth=1.2)  # type: ignore[arg-type]
        axes.plot(position, mean.value, color="black", marker="o", markersize=3)
    axes.set_ylim(-0.05, 1.05)
    axes.grid(axis="x", visible=False)
