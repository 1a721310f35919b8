"""The style that all figures share, and how they are laid out and written."""

from __future__ import annotations

import io
import pathlib
from collections.abc import Sequence
from typing import Any

from matplotlib.figure import Figure
from matplotlib.legend import Legend

from mazebench.report.looks import wrap
from mazebench.storage.files import open_whole

WIDTH = 7.0  # inches, of a page's text
LINE = 0.16  # inches, of a line of text
NAME_CHARACTERS = 40  # in a line of a legend, so that two names stand side by side
UNTRAINED_KEY = "never trained on maps of this scale"  # in legends
_DPI = 200
_MAX_PANELS_IN_ROW = 3
_MAX_LEGEND_COLUMNS = 6
_CHARACTERS_PER_INCH = 13  # of a title, in most names

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


def new_figure(width: float, height: float) -> Figure:
    """Returns an empty figure, in inches."""
    return Figure(figsize=(width, height), layout="constrained")


def panel_grid(count: int) -> tuple[int, int]:
    """Returns the rows and columns of `count` panels."""
    columns = min(count, _MAX_PANELS_IN_ROW if count != 4 else 2)
    return -(-count // columns), columns


def wrap_title(title: str, width: float) -> str:
    """Returns a title in lines of at most `width` inches."""
    return wrap(title, int(width * _CHARACTERS_PER_INCH))


def finish(figure: Figure, title: str, path: pathlib.Path, handles: Sequence[Any] = ()) -> None:
    """Gives a figure its title and, below what it has, its legend, lays it out, and writes it."""
    title = wrap_title(title, figure.get_figwidth())
    figure.suptitle(title, fontsize=10, x=0.01, ha="left")
    legend = _widest_legend(figure, handles or _curve_handles(figure))
    more = legend.get_window_extent().height / figure.dpi + LINE * title.count("\n")
    figure.set_figheight(figure.get_figheight() + more)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # the layout, which takes longest, is made once for both files
    save(figure, path)


def _widest_legend(figure: Figure, handles: Sequence[Any]) -> Legend:
    """Adds the legend with as many columns as fit, all but the last of them full."""
    for rows in range(-(-len(handles) // _MAX_LEGEND_COLUMNS), len(handles) + 1):
        columns = -(-len(handles) // rows)
        legend = figure.legend(handles=handles, loc="outside lower center", ncols=columns)
        if legend.get_window_extent().width <= figure.bbox.width or columns == 1:
            break
        legend.remove()
    return legend


def _curve_handles(figure: Figure) -> list[Any]:
    """Returns the legend's entries of all curves, each once, the paper's and the star's last."""
    named: dict[str, Any] = {}
    for axes in figure.axes:
        handles, names = axes.get_legend_handles_labels()
        named |= dict(zip(names, handles, strict=True))
    return [named[name] for name in sorted(named, key=lambda name: (name == UNTRAINED_KEY, name.endswith("(paper)")))]


def save(figure: Figure, path: pathlib.Path) -> None:
    """Writes PATH.png and PATH.pdf; the same content gives the same bytes."""
    undated = {"CreationDate": None, "Producer": None, "Creator": None}
    forms: dict[str, dict[str, Any]] = {
        "png": {"dpi": _DPI, "metadata": {"Software": None}},
        "pdf": {"metadata": undated},
    }
    for form, options in forms.items():
        content = io.BytesIO()  # matplotlib does not clean up if the disk is full
        figure.savefig(content, format=form, **options)
        with open_whole(path.with_name(f"{path.name}.{form}")) as file:
            file.write(content.getbuffer())
