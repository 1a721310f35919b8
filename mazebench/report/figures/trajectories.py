"""Trajectories on mazes: a row for each agent, a column for each episode."""

from __future__ import annotations

import pathlib
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from mazebench.maps.maze import cell_to_point
from mazebench.report.figures.style import STYLE, WIDTH, save, shorten
from mazebench.report.galleries import Drive, Gallery

# Floor, wall, wall that only the map shows, wall that the map does not show, landmark.
_CELL_COLORS = ListedColormap(["#ffffff", "#4a4e57", "#f6c7a1", "#a99bc4", "#c9dcec"])
# Without the palest yellow, which is invisible on white.
_TIME_COLORS = ListedColormap(mpl.colormaps["plasma"](np.linspace(0, 0.92, 256)))
_START, _GOAL = ("o", "#009e73", 4.5), ("*", "#d55e00", 7.5)  # marker, colour, width in points
_COLUMN, _ROW = 1.06, 1.17  # of a gallery, in sides of a maze


def draw_gallery(gallery: Gallery, path: pathlib.Path) -> None:
    """Draws a row for each agent and a column for each episode; the colour of a path shows the time."""
    rows, columns = len(gallery.drives), len(gallery.drives[0][1])
    # One axes for everything, with a maze's side as its unit: matplotlib is slow with many axes.
    width, height = 0.2 + columns * _COLUMN, rows * _ROW + 0.75
    scale = min(WIDTH / width, 1.8)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(scale * width, scale * height))
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set(xlim=(-0.2, columns * _COLUMN), ylim=(-rows * _ROW - 0.35, 0.4))
        axes.axis("off")
        axes.text(-0.17, 0.3, gallery.title, fontsize=10, va="center")
        for row, (label, drives) in enumerate(gallery.drives):
            place: dict[str, Any] = {"fontsize": 8.5, "rotation": 90, "ha": "center", "va": "center"}
            axes.text(-0.09, -row * _ROW - 0.5, shorten(label, 20), **place)
            for column, drive in enumerate(drives):
                _draw_drive(axes, drive, column * _COLUMN, -row * _ROW - 1)
                if row == 0:
                    axes.text(column * _COLUMN + 0.5, 0.06, f"maze {drive.maze}", fontsize=7.5, ha="center")
        _draw_map_key(axes, columns, -rows * _ROW - 0.05, gallery)
        save(figure, path)


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
    axes.imshow(np.linspace(0, 1, 256)[None], cmap=_TIME_COLORS, extent=extent, aspect="auto")
    axes.text(middle - 0.64, top - 0.04, "start", fontsize=7, ha="right", va="center")
    axes.text(middle + 0.64, top - 0.04, "end of the episode", fontsize=7, va="center")
