"""Figures by matplotlib: curves of tables, and their files."""

from __future__ import annotations

import io
import pathlib
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mazebench.report.table import Table
from mazebench.results.metrics import HEADLINE, SPL, SPL_GRID

WIDTH = 7.0  # inches, of a page's text
_HEIGHT = 2.2  # inches, of a panel
# Okabe and Ito's colours, told apart with any colour vision; without their yellow, which is faint on white, and with a
# dark grey for their black, which is for what the paper printed.
_PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#4d4d4d")
_MARKERS, _DASHES = "os^Dv<>PXp*h", ("-", (0, (3.7, 1.6)), (0, (6.4, 1.6, 1.0, 1.6)))
# Of what the paper printed: one colour that no agent has, and strokes where agents have areas.
_PAPER_MARKERS = {"MMN (paper)": "x", "MAH (paper)": "+", "DQN (paper)": "1", "Random (paper)": "2"}
STYLE: Any = {
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "legend.handlelength": 2.6,
    "pdf.fonttype": 42,
    "svg.fonttype": "none",
    "svg.hashsalt": "mazebench",  # the same content gives the same bytes
    "text.usetex": False,  # whatever a matplotlibrc in the working folder says
    "text.parse_math": False,  # agents' names are not formulas
}
_DODGE, _DODGES = 0.12, 0.72  # of the smallest step between levels: two agents are so far apart, all of them at most
_LINE_HEIGHT = 0.105  # of scores, that a line of text takes


class Panel(NamedTuple):
    """Two axes and the lines in them."""

    title: str
    x_name: str
    # A line for each point: `column` (whose it is), `x` and `value`, and the interval `low95` and `high95`.
    points: pd.DataFrame
    ticks: Mapping[float, str]  # texts along the x axis, at least one
    is_curve: bool = False  # intervals are bands, or else bars, those of several agents beside one another


def draw_table(table: Table, labels: Sequence[str]) -> Figure:
    """Returns the curves of a table: success rate, on time by the first factor, and SPL.

    SPL is by grid distance where the paper's SPL stands beside it. `labels` are all agents', in the order of colours.
    """
    is_printed = (table.values.source.eq("paper") & table.values.metric.eq(SPL_GRID.name)).any()
    metrics = [SPL_GRID if is_printed and metric is SPL else metric for metric in HEADLINE]
    is_curve = table.row_name == "distance" and len(table.x) > 3  # few points have bars: bands over one are not seen
    x_name = f"{table.row_name}{' (cells)' if 'distance' in table.row_name else ''}"
    single = table.values[table.values.runs.isna() & table.values.row.isin(table.x)]  # no means over training runs
    single, ticks = single.assign(x=single.row.astype(object).map(table.x)), {x: row for row, x in table.x.items()}
    panels = [
        Panel(metric.title[0].upper() + metric.title[1:], x_name, points, ticks, is_curve)
        for metric in metrics
        if len(points := single[single.metric == metric.name])
    ]
    return draw_panels(table.title, panels, labels)


@mpl.rc_context(STYLE)
def draw_panels(
    title: str,
    panels: Sequence[Panel],
    labels: Sequence[str],
    y_name: str = "",
    names: Mapping[str, str] | None = None,
) -> Figure:
    """Returns panels in a grid, the title above, and one legend below them.

    The place in `labels` gives an agent its colour and marker, and those of the paper have theirs. With `names`, of
    some lines, lines are named where they end in one of the panels on the right, in the place of the legend.
    """
    figure, grid, num_columns = make_grid(title, [panel.title for panel in panels], _HEIGHT)
    for axes, panel in zip(grid, panels, strict=True):
        _draw_panel(axes, panel, labels)
    figure.supylabel(y_name, fontsize=8)
    if names is not None:
        right = zip(grid[num_columns - 1 :: num_columns], panels[num_columns - 1 :: num_columns], strict=True)
        axes, panel = max(right, key=lambda each: each[1].points.column.nunique())
        _name_lines(axes, panel, labels, names)
        return figure
    handles = {label: line for axes in grid for line, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    lines = [name.split("\n") for name in handles]
    columns = int(np.clip(13 * WIDTH / (max(len(line) for each in lines for line in each) + 7), 1, 6))
    # The legend makes the figure higher, and leaves the panels as they are.
    figure.set_figheight(figure.get_figheight() + 0.16 * -(-len(lines) // columns) * max(map(len, lines)))
    figure.legend(handles.values(), handles, loc="outside lower center", ncols=columns)
    return figure


@mpl.rc_context(STYLE)
def save(figure: Figure, path: pathlib.Path) -> None:
    """Writes PATH.png and PATH.pdf; the same content gives the same bytes."""
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # the layout, which takes longest, is made once for all forms
    figure.savefig(f"{path}.png", dpi=200, metadata={"Software": None})
    figure.savefig(f"{path}.pdf", metadata=dict.fromkeys(("CreationDate", "Producer", "Creator")))


@mpl.rc_context(STYLE)
def to_svg(figure: Figure) -> bytes:
    """Returns a figure as the content of an SVG file."""
    content = io.BytesIO()
    figure.savefig(content, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    return content.getvalue()


def make_grid(title: str, titles: Sequence[str], height: float) -> tuple[Figure, list[Axes], int]:
    """Returns a figure, axes in it with these titles, as many beside one another as fit, and how many that is."""
    num_columns = 2 if len(titles) == 4 else min(len(titles), 3)
    num_rows = -(-len(titles) // num_columns)
    width = WIDTH if num_columns > 1 else WIDTH / 1.6
    titles = [textwrap.fill(text, int(13 * (width / num_columns - 0.5))) for text in titles]
    title = textwrap.fill(title, int(13 * width))
    height += 0.16 * max(text.count("\n") for text in titles)
    figure = Figure(figsize=(width, 0.2 + height * num_rows + 0.16 * title.count("\n")), layout="constrained")
    figure.suptitle(title, fontsize=10, x=0.01, ha="left")
    grid = [figure.add_subplot(num_rows, num_columns, place, title=text) for place, text in enumerate(titles, 1)]
    return figure, grid, num_columns


@mpl.rc_context(STYLE)
def stack(figure: Figure) -> Figure:
    """Lays the panels of a figure below one another, as a phone shows them, and returns the figure."""
    panels = figure.axes
    specs = panels[0].get_subplotspec()
    height = figure.get_figheight() / (specs.get_gridspec().nrows if specs else 1)
    figure.set_layout_engine("constrained")  # again, where it has been saved
    figure.set_size_inches(WIDTH / 1.6, height * len(panels))
    figure.suptitle(textwrap.fill(figure.get_suptitle(), int(13 * WIDTH / 1.6)), fontsize=10, x=0.01, ha="left")
    grid = figure.add_gridspec(len(panels), 1)
    for place, axes in enumerate(panels):
        axes.set_subplotspec(grid[place])
    for legend in list(figure.legends):
        handles, labels = (
            [each for each in legend.legend_handles if each],
            [text.get_text() for text in legend.get_texts()],
        )
        legend.remove()
        columns = int(np.clip(13 * WIDTH / 1.6 / (max(map(len, labels)) + 7), 1, 3))
        figure.legend(handles, labels, loc="outside lower center", ncols=columns)
    return figure


def _draw_panel(axes: Axes, panel: Panel, labels: Sequence[str]) -> None:
    points, ticks = panel.points, list(panel.ticks)
    ours = [label for label in labels if label in set(points.column)]
    printed = [label for label in _PAPER_MARKERS if label in set(points.column)]
    step = min(np.diff(ticks), default=1.0)
    dodge = 0.0 if panel.is_curve else min(_DODGE, _DODGES / max(len(ours), 1)) * step
    for place, label in enumerate([*ours, *printed]):
        own, look = points[points.column == label], _look(label, labels)
        x = own.x.astype(float) + (0 if label in printed else (place - (len(ours) - 1) / 2) * dodge)
        axes.plot(x, own.value, **look, markevery=-(-len(own) // 12), label=textwrap.fill(label, 40))
        if panel.is_curve:
            axes.fill_between(x, own.low95, own.high95, color=look["color"], alpha=0.14, linewidth=0)
        else:
            axes.vlines(x, own.low95, own.high95, color=look["color"], linewidth=0.9)
    axes.set_xlabel(panel.x_name)
    axes.set(ylim=(-0.05, 1.05), yticks=np.linspace(0, 1, 6))
    set_ticks(axes, panel.ticks)
    margin = 0.4 if panel.is_curve else step / 2
    axes.set_xlim(ticks[0] - margin, ticks[-1] + margin)


def _name_lines(axes: Axes, panel: Panel, labels: Sequence[str], names: Mapping[str, str]) -> None:
    """Writes the name of each line on the right of its end, in its colour, the highest one first."""
    ends = panel.points.sort_values("x").groupby("column", observed=True).value.last().sort_values()
    below = {label: _LINE_HEIGHT * place for place, label in enumerate(ends.index)}  # what lower names need at least
    bottom = 1 + _LINE_HEIGHT / 2
    for label, value in ends.iloc[::-1].items():
        text = textwrap.fill(names.get(label, label), 18)
        height = _LINE_HEIGHT * (text.count("\n") + 1)
        middle = min(max(float(value), below[label]), bottom - height / 2)
        bottom = middle - height / 2
        look = {"color": _look(label, labels)["color"], "va": "center", "fontsize": 8}
        axes.text(1.03, middle, text, transform=axes.get_yaxis_transform(), **look)


def set_ticks(axes: Axes, ticks: Mapping[float, str]) -> None:
    """Shows at most eight of the ticks, so that their texts do not meet."""
    shown = list(ticks)[:: -(-len(ticks) // 8)]
    axes.set_xticks(shown, [ticks[x] for x in shown])


def color_of(label: str, labels: Sequence[str]) -> str:
    """Returns the colour of an agent in the figures."""
    return str(_look(label, labels)["color"])


def _look(label: str, labels: Sequence[str]) -> dict[str, Any]:
    """Returns colour, marker and line of an agent, as `Axes.plot` takes them."""
    if label in _PAPER_MARKERS:
        dots = (0, (1.0, 1.65))
        return {"color": "#222222", "marker": _PAPER_MARKERS[label], "linestyle": dots, "linewidth": 0.9, "zorder": 4}
    turn, rank = divmod(labels.index(label), len(_PALETTE))
    # The later an agent is drawn, the finer its line: where two agree, both are seen.
    fine = {"linewidth": 1.8 - 0.15 * rank, "markersize": 4.8 - 0.35 * rank}
    marker = _MARKERS[labels.index(label) % len(_MARKERS)]
    return {"color": _PALETTE[rank], "marker": marker, "linestyle": _DASHES[min(turn, 2)], **fine}
