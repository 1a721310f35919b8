"""The figures of README.md and docs/results.md, from the records that are kept; `make results` draws them."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.results.kept import (
    LEARNED,
    LOCAL,
    NAVIGATOR,
    NO_MAP,
    ON_TIME_125,
    PATHS,
    TRUE_POSE,
    Kept,
    estimate,
)
from mazebench.report.figures import Drawn, Panel, draw_panels, draw_table, to_svg
from mazebench.report.table import Table
from mazebench.results.intervals import Estimate
from mazebench.results.metrics import is_on_time
from mazebench.storage.files import open_whole
from mazebench.tasks.tracks import LEVELS, TRACKS

# Of the report of the suite `paper`.
_FLIPS, _WARPS = "flip-hierarchical-13", "warp-local-13"
_LOCAL_AGENTS = ("mmn", "mah", "mah-paper", "dqn", "random", "MMN (paper)")  # those that do not reach every goal
_FACTORS = np.arange(1.0, 3.01, 0.125)  # of the oracle's steps
# Each line's place is its colour and marker, in all figures.
_LOOKS = (
    NAVIGATOR, LEARNED, NO_MAP, "planner-closed-loop", "mmn", "mah", "mah-paper", "dqn", "random", TRUE_POSE,
    "mmn without model and search", "sb3_agent:PPOAgent",
)  # fmt: skip

# What lines are called where they end; others by their label.
_NAMES = {
    NO_MAP: "without the map",
    TRUE_POSE: "with the true pose",
    "sb3_agent:PPOAgent": "PPO, untuned",
    "mmn without model and search": "mmn, no model and search",
    "path on the map open": "open path",
    "path on the map blocked": "blocked path",
}

# What a panel shows: by the name of a line, an estimate at each tick; None where there is none.
_Lines = dict[str, list[Estimate | None]]


def figures(kept: Kept) -> list[Drawn]:
    """Returns all figures that pages show."""
    local = kept.report[LOCAL]
    local = dataclasses.replace(local, values=local.values[local.values.column.isin(_LOCAL_AGENTS)])
    own = [each(kept) for each in (map_worth, budget, wrong_maps, what_fails, model_and_search)]
    return [*own, draw_table(local, list(_LOOKS))]


def draw_figures(chosen: Sequence[Drawn], folder: pathlib.Path) -> None:
    """Writes figures as SVG into a folder."""
    for drawn in chosen:
        with open_whole(folder / f"{drawn.name}.svg") as file:
            file.write(to_svg(drawn).encode())


def map_worth(kept: Kept) -> Drawn:
    """Returns the navigator on time with and without the map, by track and level."""
    rows = (NAVIGATOR, NO_MAP, TRUE_POSE)
    panels = {track: {row: _levels(kept, row, track) for row in rows} for track in TRACKS}
    return _figure("map-worth", "What the map is worth", panels, "on-time rate")


def budget(kept: Kept) -> Drawn:
    """Returns the share of episodes that reach the goal within a budget of steps, at level 2 of each track."""
    panels = []
    for track in TRACKS:
        runs = {row: [kept.result(row, f"{track}-2")] for row in (NAVIGATOR, NO_MAP, "sb3_agent:PPOAgent")}
        if (LEARNED, f"{track}-2") in kept.several:
            runs[LEARNED] = kept.several[LEARNED, f"{track}-2"]
        points = [
            {"column": row, "x": factor, "value": value, "low95": value, "high95": value}
            for row, results in runs.items()
            for factor in _FACTORS
            for value in [np.mean([is_on_time(each.records, factor) for each in results])]
        ]
        ticks = {x: f"{x:g}" for x in (1.0, 1.25, 2.0, 3.0)}
        panels.append(Panel(f"{track} 2", "budget, times the oracle's steps", pd.DataFrame(points), ticks, True))
    title = "Success over the budget of steps"
    return Drawn("budget", title, "", draw_panels(title, panels, _LOOKS, y_name="success rate", names=_NAMES))


def what_fails(kept: Kept) -> Drawn:
    """Returns the navigator on time where the shortest path on the map is open and where it is blocked."""
    panels = {
        track: {name: _levels(kept, NAVIGATOR, track, "blocked", (is_blocked,)) for name, is_blocked in PATHS.items()}
        for track in TRACKS
    }
    return _figure("what-fails", "Where the navigator is late", panels, "on-time rate")


def wrong_maps(kept: Kept) -> Drawn:
    """Returns success rates on wrong maps of the paper's protocol, without a lidar."""
    rows = ("planner-closed-loop", "mah", "mmn", NAVIGATOR)
    tables = {"Hierarchical, share of cells flipped": _FLIPS, "Local, maps warped by": _WARPS}
    panels = {title: {row: _of_table(kept.report[name], row) for row in rows} for title, name in tables.items()}
    ticks = [list(kept.report[name].x) for name in tables.values()]
    return _figure("wrong-maps", "Wrong maps without a lidar", panels, "success rate", "", ticks)


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
    return Drawn("model-and-search", title, "", draw_panels(title, panels, _LOOKS, y_name="success rate", names=_NAMES))


def _levels(kept: Kept, row: str, track: str, field: str = "", values: Sequence[Any] = ()) -> list[Estimate | None]:
    """Returns the share on time at the levels of a track, of the episodes that `estimate` counts."""
    return [estimate(result, ON_TIME_125, field, values) for [result] in kept.levels(row, track)]


def _of_table(table: Table, label: str) -> list[Estimate | None]:
    """Returns an agent's success rates in the rows of a table of the report."""
    values = table.values[(table.values.metric == "success_rate") & (table.values.column == label)]
    found = {
        row: Estimate(value, low, high)
        for row, value, low, high in zip(values.row, values.value, values.low95, values.high95, strict=True)
    }
    return [found.get(row) for row in table.x]


def _figure(
    name: str,
    title: str,
    panels: Mapping[str, _Lines],
    y_name: str,
    x_name: str = "level",
    ticks: Sequence[Sequence[str]] = (),
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
    labels = list(dict.fromkeys([*_LOOKS, *(label for lines in panels.values() for label in lines)]))
    return Drawn(name, title, "", draw_panels(title, drawn, labels, y_name=y_name, names=_NAMES))
