"""The report's figures for print, by matplotlib: curves with intervals, violins, and trajectories on maps."""

from __future__ import annotations

import io
import pathlib
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from mazebench.files import open_whole
from mazebench.maps.maze import cell_to_point
from mazebench.report.distributions import GRID, Distribution, Violin
from mazebench.report.episodes import Drive, Gallery
from mazebench.report.results import METRICS
from mazebench.report.table import Cell, Column, Table

# Okabe and Ito's colours, told apart with any colour vision; yellow, faint on white, comes last.
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#f0e442")
_MARKERS = "os^DvPX"
_PAPER_MARKERS = "x+1*"
_PAPER_COLOR = "#222222"
_WIDTH = 7.0  # inches, of a page's text
_DPI = 200
_MAX_PANELS_ABREAST = 3
_LEGEND_CHARACTERS = 98  # abreast, handles and gaps counted as eight each
_DODGE = 0.12  # of the smallest step between levels, that two agents stand apart
# Floor, wall, wall that only the map shows, wall that the map does not show, landmark.
_CELL_COLORS = ListedColormap(["#ffffff", "#4a4e57", "#f6c7a1", "#a99bc4", "#c9dcec"])
# Without the palest yellow, which does not show on white.
_TIME_COLORS = ListedColormap(mpl.colormaps["plasma"](np.linspace(0, 0.92, 256)))
_START, _GOAL = ("o", "#009e73", 4.5), ("*", "#d55e00", 7.5)  # marker, colour, points wide
_COLUMN, _ROW = 1.06, 1.17  # of a gallery, in sides of a maze

_STYLE: Any = {
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "pdf.fonttype": 42,
    "text.parse_math": False,  # agents' names are not formulas
}


def draw_table(table: Table, labels: Sequence[str], path: pathlib.Path) -> None:
    """Success rate and SPL by row, a curve an agent; by grid distance if the paper's SPL stands beside."""
    with_paper = any(column.is_paper and any(column.cells["spl_grid"]) for column in table.columns)
    metrics = ("success_rate", "spl_grid" if with_paper else "spl")
    with mpl.rc_context(_STYLE):
        figure = _figure(_WIDTH, 2.9)
        for index, metric in enumerate(metrics):
            axes = figure.add_subplot(1, 2, index + 1)
            _draw_curves(axes, table, metric, labels)
            axes.set_title(METRICS[metric].capitalize() if metric == "success_rate" else METRICS[metric], loc="left")
        _finish(figure, table.title, path)


def draw_table_panels(tables: Sequence[Table], title: str, labels: Sequence[str], path: pathlib.Path) -> None:
    """The success rate of several tables in panels of one scale."""
    with mpl.rc_context(_STYLE):
        rows, columns = _panel_grid(len(tables))
        figure = _figure(_WIDTH, 2.2 * rows)
        for index, table in enumerate(tables):
            axes = figure.add_subplot(rows, columns, index + 1)
            _draw_curves(axes, table, "success_rate", labels)
            axes.set_title(table.title.rpartition(", ")[2], loc="left")
            axes.set_ylabel("success rate" if index % columns == 0 else "")
        _finish(figure, title, path)


def draw_distribution(distribution: Distribution, labels: Sequence[str], path: pathlib.Path) -> None:
    """A panel an agent with a violin a level, and the mean with its interval in it."""
    with mpl.rc_context(_STYLE):
        rows, columns = _panel_grid(len(distribution.panels))
        figure = _figure(_WIDTH if columns > 1 else _WIDTH / 1.6, 2.2 * rows)
        for index, (label, violins) in enumerate(distribution.panels):
            axes = figure.add_subplot(rows, columns, index + 1)
            _draw_violins(axes, violins, PALETTE[labels.index(label) % len(PALETTE)])
            every = 1 if len(distribution.levels) <= 6 else 2
            places = range(0, len(distribution.levels), every)
            axes.set_xticks(places, [f"{distribution.levels[place]:g}" for place in places])
            axes.set_xlabel(distribution.level_name)
            axes.set_ylabel("SPL" if index % columns == 0 else "")
            axes.set_title(_shorten(label), loc="left")
        mean = Line2D([], [], color="black", marker="o", markersize=3, label="mean, 95 % interval")
        _finish(figure, distribution.title, path, [mean])


def draw_gallery(gallery: Gallery, path: pathlib.Path) -> None:
    """A row an agent, a column an episode; paths coloured by time."""
    rows, columns = len(gallery.drives), len(gallery.drives[0][1])
    # Everything in one axes, whose unit is a maze's side: matplotlib takes long over many axes.
    width, height = 0.2 + columns * _COLUMN, rows * _ROW + 0.75
    scale = min(_WIDTH / width, 1.8)
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(scale * width, scale * height))
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set(xlim=(-0.2, columns * _COLUMN), ylim=(-rows * _ROW - 0.35, 0.4))
        axes.axis("off")
        axes.text(-0.17, 0.3, gallery.title, fontsize=10, va="center")
        for row, (label, drives) in enumerate(gallery.drives):
            place: dict[str, Any] = {"fontsize": 8.5, "rotation": 90, "ha": "center", "va": "center"}
            axes.text(-0.09, -row * _ROW - 0.5, _shorten(label, 20), **place)
            for column, drive in enumerate(drives):
                _draw_drive(axes, drive, column * _COLUMN, -row * _ROW - 1)
                if row == 0:
                    axes.text(column * _COLUMN + 0.5, 0.06, f"maze {drive.maze}", fontsize=7.5, ha="center")
        _draw_map_key(axes, columns, -rows * _ROW - 0.05, gallery)
        _save(figure, path)


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
    axes.set_ylim(-0.03, 1.03)
    axes.set_xlabel(f"{table.row_name}{' (cells)' if 'distance' in table.row_name else ''}")
    if not is_curve:
        axes.set_xlim(x[0] - step / 2, x[-1] + step / 2)
    if not is_curve or len(x) <= 5:
        every = 1 if len(x) <= 8 else 2
        axes.set_xticks(x[::every], [f"{at:g}" for at in x[::every]])


def _paper_color(column: Column, labels: Sequence[str]) -> str:
    """That of the paper's agent's namesake here."""
    namesake = column.label.partition(" ")[0].lower()
    return PALETTE[labels.index(namesake) % len(PALETTE)] if namesake in labels else _PAPER_COLOR


def _draw_curve(
    axes: Axes, x: np.ndarray, cells: Sequence[Cell | None], label: str, place: int, is_curve: bool
) -> None:
    """A line with a band where many distances make a curve, else points with bars.

    The later an agent is drawn, the finer its line: where two agree, both are seen.
    """
    there = [index for index, cell in enumerate(cells) if cell]
    value, low, high = np.array([(cell.value, cell.low, cell.high) for cell in cells if cell]).T
    rank = place % len(PALETTE)
    color, marker = PALETTE[rank], _MARKERS[(place + place // len(PALETTE)) % len(_MARKERS)]
    style: dict[str, Any] = {"color": color, "marker": marker, "label": _shorten(label)}
    style |= {"markersize": 4.8 - 0.35 * rank, "linewidth": 1.8 - 0.15 * rank}
    if is_curve:
        axes.fill_between(x[there], low, high, color=color, alpha=0.16, linewidth=0)
        axes.plot(x[there], value, **style)
    else:
        errors = [np.maximum(value - low, 0), np.maximum(high - value, 0)]
        axes.errorbar(x[there], value, yerr=errors, elinewidth=0.9, capsize=1.5, alpha=0.95, **style)


def _draw_violins(axes: Axes, violins: Sequence[Violin | None], color: str) -> None:
    for position, violin in enumerate(violins):
        if violin is None:
            continue
        # Of equal width at their peaks; what is below a thousandth of it is no part of the shape.
        half = np.where(violin.density > 1e-3, 0.42 * violin.density, np.nan)
        axes.fill_betweenx(GRID, position - half, position + half, color=color, alpha=0.35, linewidth=0)
        axes.plot(position - half, GRID, color=color, linewidth=0.7)
        axes.plot(position + half, GRID, color=color, linewidth=0.7)
        mean = violin.mean
        axes.plot([position] * 2, [mean.low, mean.high], color="black", linewidth=1.2)  # type: ignore[arg-type]
        axes.plot(position, mean.value, color="black", marker="o", markersize=3)
    axes.set_ylim(-0.03, 1.03)
    axes.grid(axis="x", visible=False)


def _draw_drive(axes: Axes, drive: Drive, left: float, bottom: float) -> None:
    """The maze as a unit square, where its map differs, what the agent was sent to, and its path."""
    size = len(drive.walls)
    cells = drive.walls.astype(int)
    if drive.shown is not None:
        cells[drive.shown & ~drive.walls] = 2
        cells[~drive.shown & drive.walls] = 3
    cells[tuple(drive.landmarks.T)] = 4
    extent = (left, left + 1, bottom, bottom + 1)
    axes.imshow(cells, cmap=_CELL_COLORS, vmin=0, vmax=4, extent=extent, interpolation="none", aspect="auto")
    points = drive.points / size + (left, bottom)
    segments = np.stack([points[:-1], points[1:]], axis=1)
    path = LineCollection(list(segments), cmap=_TIME_COLORS, linewidths=1.3, capstyle="round", zorder=3)
    path.set_array(np.linspace(0, 1, len(segments)))
    axes.add_collection(path, autolim=False)
    for cell, marker, color, width in ((drive.start, *_START), (drive.goal, *_GOAL)):
        x, y = cell_to_point(cell, size) / size + (left, bottom)
        edge: dict[str, Any] = {"markeredgecolor": "white", "markeredgewidth": 0.6}
        axes.plot(x, y, marker=marker, color=color, markersize=width, zorder=4, **edge)
    outcome = f"{'✓' if drive.success else '✗ failed,'} {drive.steps} steps"
    axes.text(left + 0.5, bottom - 0.02, outcome, fontsize=7, ha="center", va="top")


def _draw_map_key(axes: Axes, columns: int, top: float, gallery: Gallery) -> None:
    """What marks and colours mean, and a bar of the colours of time."""
    drives = [drive for _, row in gallery.drives for drive in row]
    marks: list[tuple[str, str, Any]] = [("start", *_START[:2]), ("goal", *_GOAL[:2])]
    if any(len(drive.landmarks) for drive in drives):
        marks += [("landmark", "s", _CELL_COLORS(4))]
    if any(drive.shown is not None for drive in drives):
        marks += [("wall on the map only", "s", _CELL_COLORS(2)), ("wall missing on the map", "s", _CELL_COLORS(3))]
    handles = [
        Line2D([], [], linestyle="", marker=marker, color=color, markersize=6, label=name)
        for name, marker, color in marks
    ]
    key: dict[str, Any] = {"loc": "upper center", "ncols": len(handles) if columns > 3 else 2, "borderpad": 0}
    middle = columns * _COLUMN / 2
    axes.legend(handles=handles, bbox_to_anchor=(middle, top - 0.1), bbox_transform=axes.transData, **key)
    extent = (middle - 0.6, middle + 0.6, top - 0.06, top - 0.02)
    axes.imshow(np.linspace(0, 1, 256)[None], cmap=_TIME_COLORS, extent=extent, aspect="auto")
    axes.text(middle - 0.64, top - 0.04, "start", fontsize=7, ha="right", va="center")
    axes.text(middle + 0.64, top - 0.04, "end of the episode", fontsize=7, va="center")


def _figure(width: float, height: float) -> Figure:
    return Figure(figsize=(width, height), layout="constrained")


def _panel_grid(count: int) -> tuple[int, int]:
    columns = min(count, _MAX_PANELS_ABREAST if count != 4 else 2)
    return -(-count // columns), columns


def _shorten(text: str, most: int = 28) -> str:
    return text if len(text) <= most else f"{text[: most - 1]}…"


def _finish(figure: Figure, title: str, path: pathlib.Path, handles: Sequence[Any] = ()) -> None:
    """Gives a figure its title and legend, lays it out, and writes it."""
    handles = handles or _curve_handles(figure)
    figure.suptitle(title, fontsize=10, x=0.01, ha="left")
    lines = -(-sum(len(handle.get_label()) + 8 for handle in handles) // _LEGEND_CHARACTERS)
    figure.legend(handles=handles, loc="outside lower center", ncols=-(-len(handles) // lines))
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # the layout, which takes longest, is made once for both files
    _save(figure, path)


def _curve_handles(figure: Figure) -> list[Any]:
    """What the legend of all curves needs, each once, those of the paper last."""
    named: dict[str, Any] = {}
    for axes in figure.axes:
        handles, names = axes.get_legend_handles_labels()
        named |= dict(zip(names, handles, strict=True))
    return [named[name] for name in sorted(named, key=lambda name: name.endswith("(paper)"))]


def _save(figure: Figure, path: pathlib.Path) -> None:
    """Writes PATH.png and PATH.pdf; the same content gives the same bytes."""
    undated = {"CreationDate": None, "Producer": None, "Creator": None}
    forms: dict[str, dict[str, Any]] = {
        "png": {"dpi": _DPI, "metadata": {"Software": None}},
        "pdf": {"metadata": undated},
    }
    for form, options in forms.items():
        content = io.BytesIO()  # matplotlib loses its way on a disk that is full
        figure.savefig(content, format=form, **options)
        with open_whole(path.with_name(f"{path.name}.{form}")) as file:
            file.write(content.getbuffer())
