"""The figures of README.md and docs/results.md, from the records that are kept; `make results` draws them."""

from __future__ import annotations

import pathlib
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.results.kept import (
    LOCAL,
    NAVIGATOR,
    NO_MAP,
    ON_TIME_125,
    PATHS,
    TRUE_POSE,
    Kept,
    estimate,
)
from mazebench.maps.kinds import KNOWN, NOVEL
from mazebench.report.figures.describe import describe_distributions, describe_table
from mazebench.report.figures.draw import draw_figure
from mazebench.report.figures.figure import Figure, Panel, Point, Series
from mazebench.report.looks import all_looks
from mazebench.report.table import Cell
from mazebench.results.intervals import Estimate
from mazebench.tasks.tracks import TRACKS
from mazebench.tasks.tracks.base import LEVELS

_DODGE = 0.09  # of the step between two ticks, by which series stand beside one another
# Of the report of the suite `paper`.
_FLIPS, _WARPS = "flip-hierarchical-13", "warp-local-13"
_VIOLINS = "violins-noise-local-13"
_SCORES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)

# What a panel shows: by the name of a series, an estimate at each tick; None where there is none.
_Lines = dict[str, list[Estimate | None]]


def figures(kept: Kept) -> list[Figure]:
    """Returns all figures that pages show."""
    looks = all_looks(list(kept.episodes.label.cat.categories))
    violins = [each for each in describe_distributions(kept.episodes, looks) if each.name == _VIOLINS]
    of_report = [describe_table(kept.report[LOCAL], looks), *violins]
    own = [each(kept) for each in (map_worth, learning, novel_kinds, what_fails, model_and_search)]
    return [*own, *of_report]


def draw_figures(chosen: Sequence[Figure], folder: pathlib.Path) -> None:
    """Writes figures as PNG into a folder."""
    with tempfile.TemporaryDirectory() as temporary:
        for figure in chosen:
            draw_figure(figure, pathlib.Path(temporary) / figure.name)
            shutil.copy(pathlib.Path(temporary, f"{figure.name}.png"), folder)


def map_worth(kept: Kept) -> Figure:
    """Returns the navigator on time with and without the map, by track and level."""
    rows = {"navigator": NAVIGATOR, "navigator without the map": NO_MAP, "navigator with the true pose": TRUE_POSE}
    panels = {track: {label: _levels(kept, row, track) for label, row in rows.items()} for track in TRACKS}
    return _figure("map-worth", "What the map is worth: episodes on time (1.25)", panels)


def novel_kinds(kept: Kept) -> Figure:
    """Returns the navigator on time in known and in novel kinds of mazes, by track and level."""
    panels = {
        track: {
            f"navigator, {name} kinds": _levels(kept, NAVIGATOR, track, "kind", kinds)
            for name, kinds in (("known", KNOWN), ("novel", NOVEL))
        }
        for track in TRACKS
    }
    return _figure("novel-kinds", "What novel kinds of buildings cost: episodes on time (1.25)", panels)


def what_fails(kept: Kept) -> Figure:
    """Returns the navigator on time where the shortest path on the map is open and where it is blocked."""
    panels = {
        track: {
            f"navigator, {name}": _levels(kept, NAVIGATOR, track, "blocked", (is_blocked,))
            for name, is_blocked in PATHS.items()
        }
        for track in TRACKS
    }
    return _figure("what-fails", "Where the navigator is late: episodes on time (1.25)", panels)


def learning(kept: Kept) -> Figure:
    """Returns success rates on wrong maps of v1, without a lidar."""
    rows = ("planner-closed-loop", "mah", "mmn", NAVIGATOR)
    tables = {"Hierarchical, share of cells flipped": _FLIPS, "Local, maps warped by": _WARPS}
    panels = {}
    for title, name in tables.items():
        columns = {column.label: column.cells["success_rate"] for column in kept.report[name].columns}
        panels[title] = {row: [_of_cell(cell) for cell in columns[row]] for row in rows}
    ticks = [kept.report[name].rows for name in tables.values()]
    return _figure("learning", "Wrong maps without a lidar: success rate", panels, "", ticks)


def model_and_search(kept: Kept) -> Figure:
    """Returns learning curves of mmn, of Q-learning with its reading of the map, and of mah: means over their runs.

    Bars reach from the lowest to the highest run. Milestones count as the nearest tenth of a million steps.
    """
    archives = {"mmn": "mmn", "mmn without model and search": "mmn-model-false", "mah": "mah"}
    panels = []
    for distance in (6, 8, 10):
        series = []
        for label, name in archives.items():
            rates = kept.success_rates(name, distance).items()
            points = [Point(steps, float(np.mean(runs)), min(runs), max(runs)) for steps, runs in rates]
            series.append(Series(label, tuple(points), has_bars=True))
        panels.append(
            Panel(
                f"{distance} cells",
                "million agent steps",
                tuple(series),
                ticks=tuple((x, f"{x:g}") for x in (0.2, 0.4, 0.6, 0.8, 1.0)),
                y_range=(-0.05, 1.05),
                y_ticks=_SCORES,
            )
        )
    title = "Success rate on held-out mazes over training: mean, lowest and highest run"
    return Figure("model-and-search", title, "", tuple(panels), all_looks(list(archives)), panel_height=2.1)


def _levels(kept: Kept, row: str, track: str, field: str = "", values: Sequence[Any] = ()) -> list[Estimate | None]:
    """Returns the share on time at the levels of a track, of the episodes that `estimate` counts."""
    return [estimate(result, ON_TIME_125, field, values) for result in kept.levels(row, track)]


def _of_cell(cell: Cell | None) -> Estimate | None:
    if cell is None or cell.low is None or cell.high is None:
        return None
    return Estimate(cell.value, cell.low, cell.high)


def _figure(
    name: str, title: str, panels: Mapping[str, _Lines], x_name: str = "level", ticks: Sequence[Sequence[str]] = ()
) -> Figure:
    labels = list(dict.fromkeys(label for lines in panels.values() for label in lines))
    described = tuple(
        _panel(panel, lines, labels, x_name, ticks[index] if ticks else [str(level) for level in LEVELS])
        for index, (panel, lines) in enumerate(panels.items())
    )
    return Figure(name, title, "", described, all_looks(labels), panel_height=2.1)


def _panel(title: str, lines: _Lines, labels: Sequence[str], x_name: str, ticks: Sequence[str]) -> Panel:
    series = []
    for label, estimates in lines.items():
        shift = (labels.index(label) - (len(labels) - 1) / 2) * _DODGE
        points = [Point(x + shift, each.value, each.low, each.high) for x, each in enumerate(estimates) if each]
        if points:
            series.append(Series(label, tuple(points), has_bars=True))
    return Panel(
        title,
        x_name,
        tuple(series),
        ticks=tuple((float(x), text) for x, text in enumerate(ticks)),
        x_range=(-0.5, len(ticks) - 0.5),
        y_range=(-0.05, 1.05),
        y_ticks=_SCORES,
    )
