"""Figures of tables and distributions, as values."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
import pandas as pd

from mazebench.report.figures.figure import Figure, Panel, Point, Series
from mazebench.report.frame import at_common_distances, note_on_distances
from mazebench.report.looks import MEAN, Look
from mazebench.report.measures import measure
from mazebench.report.settings import Setting, level_help, level_name, short_name
from mazebench.report.table import METRICS, UNTRAINED_NOTE, Cell, Column, Table
from mazebench.report.tables import perturbed_groups
from mazebench.results.metrics import ON_TIME_METRICS

_DODGE, _DODGES = 0.12, 0.72  # of the smallest step between levels: two agents are so far apart, all of them at most
_MIN_CURVE = 4  # points of a curve with bands; fewer have bars, since bands over one point are not seen
_BAND, _BANDS = 0.16, 0.9  # opacity of a band, and of all bands together at most
_CURVE_MARGIN = 0.4  # cells, left and right of a curve
# Figures with a panel for each of several tables: their names, the beginning of the tables' names, their titles.
_PANELS = (
    ("local-sizes", "local-", "Local navigation by distance, in mazes of several sizes"),
    ("tracks", "track-", "Tracks: success rate by level"),
)

_GRID = np.linspace(0, 1, 41)  # the values of SPL at which densities are computed
_BANDWIDTH = 0.04  # of the Gaussian kernel, in SPL; fixed, so that 20 equal values are a narrow bump and no spike
_WIDEST = 0.42  # half of a violin, of the step between levels
_THINNEST = 1e-3  # of its widest; a violin ends where it is thinner

_SCORES = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)  # ticks of an axis of scores
_SCORE_RANGE = (-0.05, 1.05)


def describe_table(table: Table, looks: Mapping[str, Look]) -> Figure:
    """Returns curves by row, in a panel for each metric.

    Files have success rate, on time by the first factor, and SPL; they have SPL by grid distance where the paper's SPL
    stands beside it.
    """
    with_paper = any(column.is_paper and any(column.cells["spl_grid"]) for column in table.columns)
    in_file = ("success_rate", next(iter(ON_TIME_METRICS)), "spl_grid" if with_paper else "spl")
    panels = tuple(_curves(table, metric, metric in in_file) for metric in table.metrics)
    return Figure(table.name, table.title, table.note, panels, looks, panel_height=2.45)


def describe_several_tables(tables: Sequence[Table], looks: Mapping[str, Look]) -> Iterator[Figure]:
    """Yields figures with the success rates of tables of one kind, in panels of one scale."""
    for name, prefix, title in _PANELS:
        chosen = [table for table in tables if table.x and table.name.startswith(prefix)]
        if len(chosen) > 1:
            panels = [
                dataclasses.replace(
                    _curves(table, "success_rate"), title=table.title.rpartition(", ")[2], y_name="success rate"
                )
                for table in chosen
            ]
            marked = [UNTRAINED_NOTE] if any(UNTRAINED_NOTE in table.note for table in chosen) else []
            note = " ".join(["Success rate.", *marked])
            yield Figure(name, title, note, tuple(panels), looks, panel_height=2.0)


def describe_distributions(episodes: pd.DataFrame, looks: Mapping[str, Look]) -> list[Figure]:
    """Returns violins of SPL by the level of each perturbation, on the benchmark's eval mazes; a panel for each agent.

    Args:
      episodes: of `frame.join_episodes`.
      looks: of all agents.
    """
    of_benchmark = episodes[episodes.split == "eval"]
    return [_describe_distribution(*group, looks) for group in perturbed_groups(of_benchmark)]


def density(values: np.ndarray) -> np.ndarray:
    """Returns `[len(_GRID)]`: a kernel density estimate of `values` in [0, 1], with a peak of 1."""
    mirrored = np.concatenate([values, -values, 2 - values])
    estimate = np.exp(-(((_GRID[:, None] - mirrored) / _BANDWIDTH) ** 2) / 2).sum(axis=1)
    return estimate / estimate.max()


def _curves(table: Table, metric: str, is_in_file: bool = True) -> Panel:
    """Returns curves with bands over many distances, or else few points with bars, the agents' beside one another."""
    columns = table.columns_of(metric)
    ours = [column for column in columns if not column.is_paper]
    step = min(np.diff(table.x), default=1.0)
    is_curve = table.row_name == "distance" and len(table.x) >= _MIN_CURVE
    dodge = 0.0 if is_curve else min(_DODGE, _DODGES / max(len(ours), 1)) * step
    band = min(_BAND, _BANDS / max(len(ours), 1)) if is_curve else 0.0
    margin = _CURVE_MARGIN if is_curve else step / 2

    series = []
    for column in columns:
        shift = 0.0 if column.is_paper else (ours.index(column) - (len(ours) - 1) / 2) * dodge
        points = _points(table, column, metric, shift)
        areas = () if column.is_paper or not is_curve else (_band(points),)
        has_bars = not column.is_paper and not is_curve
        series.append(Series(column.label, points, has_bars=has_bars, areas=areas, opacity=band))
    name = METRICS[metric]
    return Panel(
        title=name[0].upper() + name[1:],
        x_name=f"{table.row_name}{' (cells)' if 'distance' in table.row_name else ''}",
        series=tuple(series),
        ticks=tuple(zip(table.x, table.rows, strict=False)),
        x_range=(table.x[0] - margin, table.x[-1] + margin),
        y_range=_SCORE_RANGE,
        y_ticks=_SCORES,
        metric=metric,
        is_in_file=is_in_file,
    )


def _points(table: Table, column: Column, metric: str, shift: float) -> tuple[Point, ...]:
    cells = zip(table.x, column.cells[metric], strict=False)
    return tuple(_point(x + shift, cell, tick) for tick, (x, cell) in enumerate(cells) if cell)


def _point(x: float, cell: Cell, tick: int) -> Point:
    return Point(x, cell.value, cell.low, cell.high, str(cell), tick, cell.is_untrained_scale)


def _band(points: Sequence[Point]) -> tuple[tuple[float, float], ...]:
    """Returns the corners of the area between the ends of the points' intervals."""
    upper = [(point.x, point.high) for point in points if point.high is not None]
    lower = [(point.x, point.low) for point in points if point.low is not None]
    return (*upper, *reversed(lower))


def _describe_distribution(
    perturbation: str, base: Setting, episodes: pd.DataFrame, looks: Mapping[str, Look]
) -> Figure:
    levels = sorted(episodes.strength.unique())
    panels = []
    for label, own in at_common_distances(episodes).groupby("label", observed=True):
        at_levels = {levels.index(level): group for level, group in own.groupby("strength")}
        means = tuple(_point(index, measure(group)["spl"], index) for index, group in at_levels.items())
        areas = tuple(area for index, group in at_levels.items() for area in _violin(index, group.spl.to_numpy()))
        violins = Series(label, areas=areas, opacity=0.35, outline=0.7)
        panels.append(
            Panel(
                title=looks[label].name,
                x_name=level_name(perturbation),
                series=(violins, Series(MEAN, means, has_line=False, has_bars=True)),
                y_name="SPL",
                ticks=tuple((index, f"{level:g}") for index, level in enumerate(levels)),
                x_range=(-0.6, len(levels) - 0.4),
                y_range=_SCORE_RANGE,
                y_ticks=_SCORES,
                agent=label,
            )
        )
    name, title = f"violins-{short_name(perturbation)}-{base.place}", f"SPL by {level_name(perturbation)}: {base}"
    note = f"{level_help(perturbation)} {note_on_distances(episodes)}".strip()
    return Figure(name, title, note, tuple(panels), looks, panel_height=2.1)


def _violin(x: float, values: np.ndarray) -> Iterator[tuple[tuple[float, float], ...]]:
    """Yields the outline around each stretch of values in which there are episodes; all violins are as wide."""
    half = _WIDEST * density(values)
    is_there = half > _THINNEST * _WIDEST
    for stretch in np.split(np.arange(len(_GRID)), np.flatnonzero(np.diff(is_there)) + 1):
        if is_there[stretch[0]]:
            right = np.column_stack([x + half[stretch], _GRID[stretch]])
            left = np.column_stack([x - half[stretch], _GRID[stretch]])
            yield tuple(map(tuple, np.concatenate([right, left[::-1]]).tolist()))
