"""The figures of README.md and docs/results.md, from the records that are kept; `make results` draws them."""

from __future__ import annotations

import pathlib
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

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
from mazebench.report.figures import Drawn, Panel, draw_distributions, draw_panels, draw_table, save
from mazebench.report.table import Table
from mazebench.results.intervals import Estimate
from mazebench.tasks.tracks import TRACKS
from mazebench.tasks.tracks.track import LEVELS

# Of the report of the suite `paper`.
_FLIPS, _WARPS = "flip-hierarchical-13", "warp-local-13"
_VIOLINS = "violins-noise-local-13"

# What a panel shows: by the name of a line, an estimate at each tick; None where there is none.
_Lines = dict[str, list[Estimate | None]]


def figures(kept: Kept) -> list[Drawn]:
    """Returns all figures that pages show."""
    violins = [each for each in draw_distributions(kept.episodes) if each.name == _VIOLINS]
    of_report = [draw_table(kept.report[LOCAL], list(kept.episodes.label.cat.categories)), *violins]
    own = [each(kept) for each in (map_worth, learning, novel_kinds, what_fails, model_and_search)]
    return [*own, *of_report]


def draw_figures(chosen: Sequence[Drawn], folder: pathlib.Path) -> None:
    """Writes figures as PNG into a folder."""
    with tempfile.TemporaryDirectory() as temporary:
        for drawn in chosen:
            save(drawn.figure, pathlib.Path(temporary) / drawn.name)
            shutil.copy(pathlib.Path(temporary, f"{drawn.name}.png"), folder)


def map_worth(kept: Kept) -> Drawn:
    """Returns the navigator on time with and without the map, by track and level."""
    rows = {"navigator": NAVIGATOR, "navigator without the map": NO_MAP, "navigator with the true pose": TRUE_POSE}
    panels = {track: {label: _levels(kept, row, track) for label, row in rows.items()} for track in TRACKS}
    return _figure("map-worth", "What the map is worth: episodes on time (1.25)", panels)


def novel_kinds(kept: Kept) -> Drawn:
    """Returns the navigator on time in known and in novel kinds of mazes, by track and level."""
    panels = {
        track: {
            f"navigator, {name} kinds": _levels(kept, NAVIGATOR, track, "kind", kinds)
            for name, kinds in (("known", KNOWN), ("novel", NOVEL))
        }
        for track in TRACKS
    }
    return _figure("novel-kinds", "What novel kinds of buildings cost: episodes on time (1.25)", panels)


def what_fails(kept: Kept) -> Drawn:
    """Returns the navigator on time where the shortest path on the map is open and where it is blocked."""
    panels = {
        track: {
            f"navigator, {name}": _levels(kept, NAVIGATOR, track, "blocked", (is_blocked,))
            for name, is_blocked in PATHS.items()
        }
        for track in TRACKS
    }
    return _figure("what-fails", "Where the navigator is late: episodes on time (1.25)", panels)


def learning(kept: Kept) -> Drawn:
    """Returns success rates on wrong maps of the paper's protocol, without a lidar."""
    rows = ("planner-closed-loop", "mah", "mmn", NAVIGATOR)
    tables = {"Hierarchical, share of cells flipped": _FLIPS, "Local, maps warped by": _WARPS}
    panels = {title: {row: _of_table(kept.report[name], row) for row in rows} for title, name in tables.items()}
    ticks = [list(kept.report[name].x) for name in tables.values()]
    return _figure("learning", "Wrong maps without a lidar: success rate", panels, "", ticks)


def model_and_search(kept: Kept) -> Drawn:
    """Returns learning curves of mmn, of Q-learning with its reading of the map, and of mah: means over their runs.

    Bars reach from the lowest to the highest run. Milestones count as the nearest tenth of a million steps.
    """
    archives = {"mmn": "mmn", "mmn without model and search": "mmn-model-false", "mah": "mah"}
    panels = []
    for distance in (6, 8, 10):
        points = [
            {"column": label, "x": steps, "value": np.mean(runs), "low95": min(runs), "high95": max(runs)}
            for label, name in archives.items()
            for steps, runs in kept.success_rates(name, distance).items()
        ]
        ticks = {x: f"{x:g}" for x in (0.2, 0.4, 0.6, 0.8, 1.0)}
        panels.append(Panel(f"{distance} cells", "million agent steps", pd.DataFrame(points), ticks))
    title = "Success rate on held-out mazes over training: mean, lowest and highest run"
    return Drawn("model-and-search", title, "", draw_panels(title, panels, list(archives)))


def _levels(kept: Kept, row: str, track: str, field: str = "", values: Sequence[Any] = ()) -> list[Estimate | None]:
    """Returns the share on time at the levels of a track, of the episodes that `estimate` counts."""
    return [estimate(result, ON_TIME_125, field, values) for result in kept.levels(row, track)]


def _of_table(table: Table, label: str) -> list[Estimate | None]:
    """Returns an agent's success rates in the rows of a table of the report."""
    values = table.values[(table.values.metric == "success_rate") & (table.values.column == label)]
    found = {
        row: Estimate(value, low, high)
        for row, value, low, high in zip(values.row, values.value, values.low95, values.high95, strict=True)
    }
    return [found.get(row) for row in table.x]


def _figure(
    name: str, title: str, panels: Mapping[str, _Lines], x_name: str = "level", ticks: Sequence[Sequence[str]] = ()
) -> Drawn:
    drawn = []
    for index, (panel, lines) in enumerate(panels.items()):
        points = [
            {"column": label, "x": x, "value": each.value, "low95": each.low, "high95": each.high}
            for label, estimates in lines.items()
            for x, each in enumerate(estimates)
            if each
        ]
        texts = ticks[index] if ticks else map(str, LEVELS)
        drawn.append(Panel(panel, x_name, pd.DataFrame(points), dict(enumerate(texts))))
    labels = list(dict.fromkeys(label for lines in panels.values() for label in lines))
    return Drawn(name, title, "", draw_panels(title, drawn, labels))
