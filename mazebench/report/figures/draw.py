"""Figures drawn by matplotlib, as PNG and PDF."""

from __future__ import annotations

import html
import io
import pathlib
import re
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.legend import Legend
from matplotlib.patches import Polygon
from matplotlib.ticker import EngFormatter

from mazebench.report.figures.figure import Figure, Panel, Series
from mazebench.report.looks import PAPER_MARKERS, Look, wrap
from mazebench.storage.files import open_whole

WIDTH = 7.0  # inches, of a page's text
LINE = 0.16  # inches, of a line of text
STYLE: Any = {
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "legend.handlelength": 2.6,
    "pdf.fonttype": 42,
    "text.parse_math": False,  # agents' names are not formulas
}

_NAME_CHARACTERS = 40  # in a line of a legend, so that two names stand side by side
_CHARACTERS_PER_INCH = 13  # of a title, in most names
_STAR_KEY = "never trained on maps of this scale"  # in legends
_DPI = 200
_MAX_PANELS_IN_ROW = 3
_MAX_LEGEND_COLUMNS = 6
_MAX_TICKS = 8
_Y_AXIS = 0.5  # inches, of a panel's width


def draw_figure(figure: Figure, path: pathlib.Path) -> str:
    """Writes PATH.png and PATH.pdf, and returns the figure as SVG."""
    with mpl.rc_context(STYLE):
        canvas = lay_out(figure)
        save(canvas, path)
        return to_svg(canvas, figure.name, figure.title)


def lay_out(figure: Figure) -> Canvas:
    """Returns a figure drawn: its panels in a grid, its title above, and one legend below them."""
    panels = [panel for panel in figure.panels if panel.is_in_file]
    num_columns = min(len(panels), _MAX_PANELS_IN_ROW if len(panels) != 4 else 2)
    num_rows = -(-len(panels) // num_columns)
    width = WIDTH if num_columns > 1 else WIDTH / 1.6
    titles = [wrap_title(panel.title, width / num_columns - _Y_AXIS) for panel in panels]
    height = figure.panel_height + LINE * max(title.count("\n") for title in titles)
    canvas = Canvas(figsize=(width, 0.2 + height * num_rows), layout="constrained")

    for index, (panel, title) in enumerate(zip(panels, titles, strict=True)):
        axes = canvas.add_subplot(num_rows, num_columns, index + 1)
        for series in panel.series:
            _draw_series(axes, series, figure.looks[series.label])
        _draw_axes(axes, panel)
        axes.set_title(title, loc="left")
        axes.set_ylabel(panel.y_name if index % num_columns == 0 else "")

    # The legend and further lines of the title make the figure higher, and leave the panels as they are.
    title = wrap_title(figure.title, width)
    canvas.suptitle(title, fontsize=10, x=0.01, ha="left")
    legend = _widest_legend(canvas, _legend_handles(canvas))
    more = legend.get_window_extent().height / canvas.dpi + LINE * title.count("\n")
    canvas.set_figheight(canvas.get_figheight() + more)
    canvas.draw_without_rendering()
    canvas.set_layout_engine("none")  # the layout, which takes longest, is made once for both files
    return canvas


def wrap_title(title: str, width: float) -> str:
    """Returns a title in lines of at most `width` inches."""
    return wrap(title, int(width * _CHARACTERS_PER_INCH))


def save(canvas: Canvas, path: pathlib.Path) -> None:
    """Writes PATH.png and PATH.pdf; the same content gives the same bytes."""
    undated = {"CreationDate": None, "Producer": None, "Creator": None}
    forms: dict[str, dict[str, Any]] = {
        "png": {"dpi": _DPI, "metadata": {"Software": None}},
        "pdf": {"metadata": undated},
    }
    for form, options in forms.items():
        content = io.BytesIO()  # matplotlib does not clean up if the disk is full
        canvas.savefig(content, format=form, **options)
        with open_whole(path.with_name(f"{path.name}.{form}")) as file:
            file.write(content.getbuffer())


def to_svg(canvas: Canvas, name: str, title: str) -> str:
    """Returns a figure as an SVG element for a page: its ids begin with `name`, so that no other figure has them."""
    content = io.StringIO()
    undated = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": name}):
        canvas.savefig(content, format="svg", metadata=undated)
    svg = content.getvalue()
    svg = re.sub(r"<defs>\s*<style.*?</style>\s*</defs>", "", svg[svg.index("<svg") :], count=1, flags=re.DOTALL)
    svg = re.sub(r'( id="|href="#|url\(#)', rf"\g<1>{name}-", svg)
    return svg.replace("<svg", f'<svg role="img" aria-label="{html.escape(title)}"', 1)


def _draw_series(axes: Axes, series: Series, look: Look) -> None:
    for corners in series.areas:
        axes.add_patch(Polygon(corners, facecolor=look.color, alpha=series.opacity, linewidth=0))
        if series.outline:
            axes.add_patch(Polygon(corners, fill=False, edgecolor=look.color, linewidth=series.outline))
    if not series.points:
        return

    is_paper = series.label in PAPER_MARKERS
    style: dict[str, Any] = {
        "color": look.color,
        "marker": look.marker,
        "markersize": look.size,
        "markevery": series.mark_every,
        "linewidth": look.width,
        "linestyle": ((0, look.dashes) if look.dashes else "-") if series.has_line else "",
        "label": wrap(look.name, _NAME_CHARACTERS),
        "zorder": 4 if is_paper else 2,
    }
    x, value = np.array([(point.x, point.value) for point in series.points]).T
    axes.plot(x, value, **style)
    for point in series.points:
        if series.has_bars and point.low is not None and point.high is not None:
            axes.plot([point.x] * 2, [point.low, point.high], color=look.color, linewidth=0.9, label="_bar")
        if point.is_starred:
            axes.annotate("*", (point.x, point.value), (3, 1), textcoords="offset points")
            axes.plot([], [], linestyle="", marker=(6, 2, 0), markersize=5, color="black", label=_STAR_KEY)


def _draw_axes(axes: Axes, panel: Panel) -> None:
    axes.set_xlabel(panel.x_name)
    if panel.ticks:
        positions, texts = zip(*panel.ticks[:: -(-len(panel.ticks) // _MAX_TICKS)], strict=True)
        axes.set_xticks(positions, texts)
    else:
        axes.xaxis.set_major_formatter(EngFormatter(sep=""))
    if panel.x_range:
        axes.set_xlim(*panel.x_range)
    if panel.y_range:
        axes.set_ylim(*panel.y_range)
    if panel.y_ticks:
        axes.set_yticks(panel.y_ticks)


def _widest_legend(canvas: Canvas, handles: Sequence[Any]) -> Legend:
    """Adds the legend with as many columns as fit, all but the last of them full."""
    for rows in range(-(-len(handles) // _MAX_LEGEND_COLUMNS), len(handles) + 1):
        columns = -(-len(handles) // rows)
        legend = canvas.legend(handles=handles, loc="outside lower center", ncols=columns)
        if legend.get_window_extent().width <= canvas.bbox.width or columns == 1:
            break
        legend.remove()
    return legend


def _legend_handles(canvas: Canvas) -> list[Any]:
    """Returns the legend's entries of all series, each once, the paper's and the star's last."""
    named: dict[str, Any] = {}
    for axes in canvas.axes:
        handles, names = axes.get_legend_handles_labels()
        named |= dict(zip(names, handles, strict=True))
    return [named[name] for name in sorted(named, key=lambda name: (name == _STAR_KEY, name in PAPER_MARKERS))]
