"""Figures by matplotlib: curves of tables, violins of distributions, and their files."""

from __future__ import annotations

import html
import io
import pathlib
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from mazebench.report.episodes import at_common_distances
from mazebench.report.table import METRICS, UNTRAINED_NOTE, Table
from mazebench.report.tables import level_help, level_name, note_on_distances, perturbed_groups, perturbed_name
from mazebench.results.intervals import mean_interval
from mazebench.results.metrics import ON_TIME_METRICS
from mazebench.storage.files import open_whole

WIDTH = 7.0  # inches, of a page's text
# Okabe and Ito's colours, told apart with any colour vision; without their yellow, which is faint on white, and with a
# dark grey for their black, which is for means and intervals.
_PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#4d4d4d")
_MARKERS, _DASHES = "os^Dv<>PXp*h", ("-", (0, (3.7, 1.6)), (0, (6.4, 1.6, 1.0, 1.6)))
# Of what the paper printed: one colour that no agent has, and strokes where agents have areas.
_PAPER_MARKERS = {"MMN (paper)": "x", "MAH (paper)": "+", "DQN (paper)": "1", "Random (paper)": "2"}
_STYLE: Any = {
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
    "text.parse_math": False,  # agents' names are not formulas
}
_BELOW: Any = "outside lower center"
_DODGE, _DODGES = 0.12, 0.72  # of the smallest step between levels: two agents are so far apart, all of them at most
_LINE_HEIGHT = 0.105  # of scores, that a line of text takes
_MIN_CURVE = 4  # points of a curve with bands; fewer have bars, since bands over one point are not seen
# Figures with a panel for each of several tables: their names, the beginning of the tables' names, their titles.
_SEVERAL = (
    ("local-sizes", "local-", "Local navigation by distance, in mazes of several sizes"),
    ("tracks", "track-", "Tracks: success rate by level"),
)
_GRID = np.linspace(0, 1, 41)  # the values of SPL at which densities are computed
_BANDWIDTH = 0.04  # of the Gaussian kernel, in SPL; fixed, so that 20 equal values are a narrow bump and no spike
_WIDEST = 0.42  # half of a violin, of the step between levels
_THINNEST = 1e-3  # of its widest; a violin ends where it is thinner


class Panel(NamedTuple):
    """Two axes and the lines in them."""

    title: str
    x_name: str
    # A line for each point: `column` (whose it is), `x` and `value`; where there are intervals also `low95` and
    # `high95`; `mark` is drawn beside the point.
    points: pd.DataFrame
    ticks: Mapping[float, str] = {}  # texts along the x axis; those of matplotlib if there are none
    is_curve: bool = False  # intervals are bands, or else bars, those of several agents beside one another
    y_range: tuple[float, float] | None = (-0.05, 1.05)  # of scores; what the values need if None


class Drawn(NamedTuple):
    """A figure with its words."""

    name: str  # of its files
    title: str
    note: str
    figure: Figure


def draw_table(table: Table, labels: Sequence[str]) -> Drawn:
    """Returns the curves of a table: success rate, on time by the first factor, and SPL.

    SPL is by grid distance where the paper's SPL stands beside it. `labels` are all agents', in the order of colours.
    """
    is_printed = (table.values.source.eq("paper") & table.values.metric.eq("spl_grid")).any()
    metrics = ("success_rate", next(iter(ON_TIME_METRICS)), "spl_grid" if is_printed else "spl")
    names = {metric: METRICS[metric][0].upper() + METRICS[metric][1:] for metric in metrics if metric in table.metrics}
    panels = [_panel(table, metric, name) for metric, name in names.items()]
    return Drawn(table.name, table.title, table.note, draw_panels(table.title, panels, labels))


def draw_several_tables(tables: Sequence[Table], labels: Sequence[str]) -> Iterator[Drawn]:
    """Yields figures with the success rates of tables of one kind."""
    for name, prefix, title in _SEVERAL:
        chosen = [table for table in tables if table.x and table.name.startswith(prefix)]
        if len(chosen) > 1:
            panels = [_panel(table, "success_rate", table.title.rpartition(", ")[2]) for table in chosen]
            note = "Success rate." + f" {UNTRAINED_NOTE}" * any(table.values["mark"].eq("*").any() for table in chosen)
            yield Drawn(name, title, note, draw_panels(title, panels, labels))


def draw_distributions(episodes: pd.DataFrame) -> Iterator[Drawn]:
    """Yields violins of SPL by the level of each perturbation, on the benchmark's eval mazes, a panel per agent."""
    for perturbation, base, group in perturbed_groups(episodes[episodes.split == "eval"]):
        levels = sorted(group.strength.unique())
        agents = list(at_common_distances(group).groupby("label", observed=True))
        title = f"SPL by {level_name(perturbation)}: {base}"
        note = f"{level_help(perturbation)} {note_on_distances(group)} Dots are means with 95 % intervals."
        with mpl.rc_context(_STYLE):
            figure, grid = _make_grid(title, [label for label, _ in agents], 2.1)
            for axes, (_, own) in zip(grid, agents, strict=True):
                for level, at_level in own.groupby("strength"):
                    _draw_violin(axes, levels.index(level), at_level)
                _set_ticks(axes, {index: f"{level:g}" for index, level in enumerate(levels)})
                axes.set(xlabel=level_name(perturbation), ylabel="SPL", xlim=(-0.6, len(levels) - 0.4))
                axes.set_ylim(-0.05, 1.05)
        yield Drawn(f"violins-{perturbed_name(perturbation, base)}", title, " ".join(note.split()), figure)


def draw_panels(
    title: str,
    panels: Sequence[Panel],
    labels: Sequence[str],
    height: float = 2.2,
    y_name: str = "",
    names: Mapping[str, str] | None = None,
) -> Figure:
    """Returns panels of `height` inches in a grid, the title above, and one legend below them.

    The place in `labels` gives an agent its colour and marker, and those of the paper have theirs. With `names`, of
    some lines, lines are named where they end in one of the panels on the right, in the place of the legend.
    """
    with mpl.rc_context(_STYLE):
        figure, grid = _make_grid(title, [panel.title for panel in panels], height)
        for axes, panel in zip(grid, panels, strict=True):
            _draw_panel(axes, panel, labels)
        figure.supylabel(y_name, fontsize=8)
        if names is not None:
            num_columns = _num_columns(len(panels))
            right = range(num_columns - 1, len(panels), num_columns)
            last = max(right, key=lambda index: panels[index].points.column.nunique())
            _name_lines(grid[last], panels[last], labels, names)
            return figure
        handles: dict[str, Any] = {}
        for axes in grid:
            handles |= dict(zip(*axes.get_legend_handles_labels()[::-1], strict=True))
        order = sorted(handles, key=lambda name: name in _PAPER_MARKERS)
        lines = [name.split("\n") for name in order]
        columns = int(np.clip(13 * WIDTH / (max(len(line) for each in lines for line in each) + 7), 1, 6))
        # The legend makes the figure higher, and leaves the panels as they are.
        height_of_legend = 0.16 * -(-len(order) // columns) * max(map(len, lines))
        figure.set_figheight(figure.get_figheight() + height_of_legend)
        figure.legend([handles[name] for name in order], order, loc=_BELOW, ncols=columns)
    return figure


def save(figure: Figure, path: pathlib.Path) -> None:
    """Writes PATH.png and PATH.pdf; the same content gives the same bytes."""
    with mpl.rc_context(_STYLE):
        figure.draw_without_rendering()
    figure.set_layout_engine("none")  # the layout, which takes longest, is made once for all forms
    undated = {"CreationDate": None, "Producer": None, "Creator": None}
    forms: dict[str, dict[str, Any]] = {
        "png": {"dpi": 200, "metadata": {"Software": None}},
        "pdf": {"metadata": undated},
    }
    for form, options in forms.items():
        content = io.BytesIO()  # matplotlib does not clean up if the disk is full
        with mpl.rc_context(_STYLE):
            figure.savefig(content, format=form, **options)
        with open_whole(path.with_name(f"{path.name}.{form}")) as file:
            file.write(content.getbuffer())


def to_svg(drawn: Drawn) -> str:
    """Returns a figure as an SVG element for a page: its ids begin with its name, so that no other figure has them."""
    content = io.StringIO()
    with mpl.rc_context(_STYLE | {"svg.hashsalt": drawn.name}):
        drawn.figure.savefig(content, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    svg = content.getvalue()
    svg = re.sub(r"<defs>\s*<style.*?</style>\s*</defs>", "", svg[svg.index("<svg") :], count=1, flags=re.DOTALL)
    svg = re.sub(r'( id="|href="#|url\(#)', rf"\g<1>{drawn.name}-", svg)
    # Hundredths of a point are fine enough.
    svg = re.sub(r"<[^>]+>", lambda tag: re.sub(r"(\.\d\d)\d+", r"\1", tag[0]), svg)
    svg = re.sub(r"\n\s+", "\n", svg)
    return svg.replace("<svg", f'<svg role="img" aria-label="{html.escape(drawn.title)}"', 1)


def _num_columns(num_panels: int) -> int:
    """Returns how many panels are beside one another."""
    return min(num_panels, 3 if num_panels != 4 else 2)


def _make_grid(title: str, titles: Sequence[str], height: float) -> tuple[Figure, list[Axes]]:
    """Returns a figure with axes that have these titles, as many as fit beside one another."""
    num_columns = _num_columns(len(titles))
    num_rows = -(-len(titles) // num_columns)
    width = WIDTH if num_columns > 1 else WIDTH / 1.6
    titles = [textwrap.fill(text, int(13 * (width / num_columns - 0.5))) for text in titles]
    title = textwrap.fill(title, int(13 * width))
    height += 0.16 * max(text.count("\n") for text in titles)
    figure = Figure(figsize=(width, 0.2 + height * num_rows + 0.16 * title.count("\n")), layout="constrained")
    figure.suptitle(title, fontsize=10, x=0.01, ha="left")
    grid = [figure.add_subplot(num_rows, num_columns, index + 1) for index in range(len(titles))]
    for axes, text in zip(grid, titles, strict=True):
        axes.set_title(text)
    return figure, grid


def _panel(table: Table, metric: str, title: str) -> Panel:
    values = table.values[(table.values.metric == metric) & table.values.row.isin(table.x)]
    points = values.assign(x=values.row.astype(object).map(table.x))
    is_curve = table.row_name == "distance" and len(table.x) >= _MIN_CURVE
    x_name = f"{table.row_name}{' (cells)' if 'distance' in table.row_name else ''}"
    return Panel(title, x_name, points, {x: row for row, x in table.x.items()}, is_curve)


def _draw_panel(axes: Axes, panel: Panel, labels: Sequence[str]) -> None:
    points, ticks = panel.points, list(panel.ticks.items())
    ours = [label for label in points.column.unique() if label not in _PAPER_MARKERS]
    step = min(np.diff([x for x, _ in ticks]), default=1.0)
    dodge = 0.0 if panel.is_curve or not ticks else min(_DODGE, _DODGES / max(len(ours), 1)) * step
    for label, own in points.groupby("column", observed=True, sort=False):
        look = _look(label, labels)
        x = own.x.astype(float) + (0 if label in _PAPER_MARKERS else (ours.index(label) - (len(ours) - 1) / 2) * dodge)
        axes.plot(x, own.value, **look, markevery=-(-len(own) // 12), label=textwrap.fill(label, 40))
        if "low95" in own and own.low95.notna().any():
            if panel.is_curve:
                axes.fill_between(x, own.low95, own.high95, color=look["color"], alpha=0.14, linewidth=0)
            else:
                axes.vlines(x, own.low95, own.high95, color=look["color"], linewidth=0.9)
        for at, value, mark in zip(x, own.value, own.get("mark", [""] * len(own)), strict=True):
            if mark == "*":
                axes.annotate(mark, (at, value), (3, 1), textcoords="offset points")
    axes.set_xlabel(panel.x_name)
    if panel.y_range:
        axes.set(ylim=panel.y_range, yticks=np.linspace(0, 1, 6))
    if ticks:
        _set_ticks(axes, panel.ticks)
        margin = 0.4 if panel.is_curve else step / 2
        axes.set_xlim(ticks[0][0] - margin, ticks[-1][0] + margin)
    else:
        axes.xaxis.set_major_formatter(EngFormatter(sep=""))


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


def _set_ticks(axes: Axes, ticks: Mapping[float, str]) -> None:
    """Shows at most eight of the ticks, so that their texts do not meet."""
    shown = list(ticks)[:: -(-len(ticks) // 8)]
    axes.set_xticks(shown, [ticks[x] for x in shown])


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


def _draw_violin(axes: Axes, x: int, episodes: pd.DataFrame) -> None:
    """Draws the distribution of SPL at one level, and its mean; all violins are as wide."""
    half = _WIDEST * density(episodes.spl.to_numpy())
    is_there = half > _THINNEST * _WIDEST
    axes.fill_betweenx(_GRID, x - half, x + half, is_there, color=_PALETTE[0], alpha=0.35, linewidth=0.7)
    mean = mean_interval(episodes.spl.to_numpy(), episodes.maze_index.to_numpy())
    axes.plot(x, mean.value, "o", color="black", markersize=3)
    axes.vlines(x, mean.low, mean.high, color="black", linewidth=0.9)


def density(values: np.ndarray) -> np.ndarray:
    """Returns `[len(_GRID)]`: a kernel density estimate of `values` in [0, 1], reflected at both, with a peak of 1."""
    mirrored = np.concatenate([values, -values, 2 - values])
    estimate = np.exp(-(((_GRID[:, None] - mirrored) / _BANDWIDTH) ** 2) / 2).sum(axis=1)
    return estimate / estimate.max()
