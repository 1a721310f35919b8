"""The style that all figures share, and how they are laid out and written."""

from __future__ import annotations

import io
import pathlib
from collections.abc import Sequence
from typing import Any

from matplotlib.figure import Figure

from mazebench.storage.files import open_whole

# Okabe and Ito's colours, told apart with any colour vision; yellow, faint on white, comes last.
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#f0e442")
WIDTH = 7.0  # inches, of a page's text
_DPI = 200
_MAX_PANELS_IN_ROW = 3
_LEGEND_CHARACTERS = 98  # in a line; a handle with its gaps counts as eight

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


def shorten(text: str, most: int = 32) -> str:
    """Returns at most `most` characters of a label: its beginning and its end."""
    if len(text) <= most:
        return text
    end = most // 2
    return f"{text[: most - end - 1]}…{text[-end:]}"


def finish(figure: Figure, title: str, path: pathlib.Path, handles: Sequence[Any] = ()) -> None:
    """Gives a figure its title and legend, lays it out, and writes it."""
    handles = handles or _curve_handles(figure)
    figure.suptitle(title, fontsize=10, x=0.01, ha="left")
    lines = -(-sum(len(handle.get_label()) + 8 for handle in handles) // _LEGEND_CHARACTERS)
    figure.legend(handles=handles, loc="outside lower center", ncols=-(-len(handles) // lines))
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # the layout, which takes longest, is made once for both files
    save(figure, path)


def _curve_handles(figure: Figure) -> list[Any]:
    """Returns the legend's entries of all curves, each once, the paper's last."""
    named: dict[str, Any] = {}
    for axes in figure.axes:
        handles, names = axes.get_legend_handles_labels()
        named |= dict(zip(names, handles, strict=True))
    return [named[name] for name in sorted(named, key=lambda name: name.endswith("(paper)"))]


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
