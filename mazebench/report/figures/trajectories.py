"""Trajectories on mazes: a row for each agent, a column for each episode."""

from __future__ import annotations

import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from mazebench.maps import colors
from mazebench.maps.maze import cell_to_point
from mazebench.report.figures.draw import LINE, STYLE, WIDTH, save, wrap_title
from mazebench.report.figures.galleries import Drive, Gallery
from mazebench.report.looks import Look

# The page has the same: floor, wall, wall that only the map shows, wall that the map does not show, landmark.
CELL_COLORS = {
    "floor": "#ffffff",
    "wall": "#4a4e57",
    "false-wall": "#f6c7a1",
    "lost-wall": "#a99bc4",
    "landmark": "#c9dcec",
}
_CELL_COLORS = ListedColormap(list(CELL_COLORS.values()))
# Without the palest yellow, which is invisible on white.
TIME_COLORS = ListedColormap(mpl.colormaps["plasma"](np.linspace(0, 0.92, 256)))
_START, _GOAL = ("o", colors.START, 4.5), ("*", colors.GOAL, 7.5)  # marker, colour, width in points
# In sides of a maze: the margins left and right, the width of a column, the gap in it, the height of the key.
_MARGIN, _COLUMN, _GAP, _KEY = 0.05, 1.06, 0.06, 0.4
_MIN_COLUMNS = 3  # for which there is room: title and key need it
_MAX_SIDE = 1.8  # inches, of a maze


def draw_gallery(gallery: Gallery, looks: Mapping[str, Look], path: pathlib.Path) -> None:
    """Draws a row for each agent and a column for each episode; the colour of a path shows the time."""
    rows, columns = len(gallery.drives), len(gallery.drives[0][1])
    # One axes for everything, with a maze's side as its unit: matplotlib is slow with many axes.
    width = 2 * _MARGIN + max(columns, _MIN_COLUMNS) * _COLUMN - _GAP
    scale = min(WIDTH / width, _MAX_SIDE)
    line = LINE / scale
    title = wrap_title(gallery.title, scale * width)
    names = [wrap_title(looks[label].name, scale * width) for label, _ in gallery.drives]
    heads = [wrap_title(f"maze {drive.maze}", scale) for drive in gallery.drives[0][1]]
    above = line * (1.5 + _most_lines([title]) + _most_lines(heads))
    below_name = line * (_most_lines(names) + 0.1)
    row_height = below_name + 1 + 1.6 * line
    height = above + rows * row_height + _KEY
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(scale * width, scale * height))
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set(xlim=(-_MARGIN, width - _MARGIN), ylim=(above - height, above))
        axes.axis("off")
        axes.text(0, above - line / 2, title, fontsize=10, va="top")
        for column, head in enumerate(heads):
            axes.text(column * _COLUMN + 0.5, line / 3, head, fontsize=7.5, ha="center", va="bottom")
        for row, (name, (_, drives)) in enumerate(zip(names, gallery.drives, strict=True)):
            bottom = -row * row_height - below_name - 1
            axes.text(0, bottom + 1 + line / 3, name, fontsize=8.5, va="bottom")
            for column, drive in enumerate(drives):
                _draw_drive(axes, drive, column * _COLUMN, bottom)
        _draw_map_key(axes, columns, -rows * row_height - 0.05, gallery)
        save(figure, path)


def _most_lines(texts: Sequence[str]) -> int:
    return max(1 + text.count("\n") for text in texts)


def _draw_drive(axes: Axes, drive: Drive, left: float, bottom: float) -> None:
    """Draws the maze as a unit square, the cells in which its map differs, landmarks, start, goal, and the path."""
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
    path = LineCollection(list(segments), cmap=TIME_COLORS, linewidths=1.3, capstyle="round", zorder=3)
    path.set_array(np.linspace(0, 1, len(segments)))
    axes.add_collection(path, autolim=False)
    for cell, marker, color, width in ((drive.start, *_START), (drive.goal, *_GOAL)):
        x, y = cell_to_point(cell, size) / size + (left, bottom)
        edge: dict[str, Any] = {"markeredgecolor": "white", "markeredgewidth": 0.6}
        axes.plot(x, y, marker=marker, color=color, markersize=width, zorder=4, **edge)
    outcome = f"{'✓' if drive.success else '✗ failed,'} {drive.steps} steps"
    axes.text(left + 0.5, bottom - 0.02, outcome, fontsize=7, ha="center", va="top")


def _draw_map_key(axes: Axes, columns: int, top: float, gallery: Gallery) -> None:
    """Draws the legend of marks and colours, and a bar with the colours of time."""
    drives = [drive for _, row in gallery.drives for drive in row]
    marks: list[tuple[str, str, Any]] = [("start", *_START[:2]), ("goal", *_GOAL[:2])]
    if any(len(drive.landmarks) for drive in drives):
        marks += [("landmark", "s", _CELL_COLORS(4))]
    if any(drive.shown is not None and (drive.shown != drive.walls).any() for drive in drives):
        marks += [("wall on the map only", "s", _CELL_COLORS(2)), ("wall missing on the map", "s", _CELL_COLORS(3))]
    handles = [
        Line2D([], [], linestyle="", marker=marker, color=color, markersize=6, label=name)
        for name, marker, color in marks
    ]
    key: dict[str, Any] = {"loc": "upper center", "ncols": len(handles) if columns > 3 else 2, "borderpad": 0}
    middle = columns * _COLUMN / 2
    axes.legend(handles=handles, bbox_to_anchor=(middle, top - 0.1), bbox_transform=axes.transData, **key)
    extent = (middle - 0.6, middle + 0.6, top - 0.06, top - 0.02)
    axes.imshow(np.linspace(0, 1, 256)[None], cmap=TIME_COLORS, extent=extent, aspect="auto")
    axes.text(middle - 0.64, top - 0.04, "start", fontsize=7, ha="right", va="center")
    axes.text(middle + 0.64, top - 0.04, "end of the episode", fontsize=7, va="center")
