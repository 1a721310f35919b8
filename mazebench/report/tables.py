"""The report's tables: which results stand in which, and the figures in their cells."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from mazebench.evaluation.metrics import bootstrap_interval, success_interval
from mazebench.report.pooling import NOTE, pool_columns, training_runs
from mazebench.report.reference import paper_columns
from mazebench.report.results import METRICS, PERTURBATIONS, Result, Setting
from mazebench.report.table import Cell, Column, Table

LEVEL_NAMES = {"map_flip": "share of map cells flipped", "map_warp": "map warp", "position_noise": "position noise (m)"}

_DEFAULT_LANDMARKS = 5  # cells between landmarks; the paper's choice wherever it varies something else


def build_tables(results: Sequence[Result], labels: Sequence[str]) -> list[Table]:
    """All tables that `results` can fill, with a column for each of `labels` that has a result in them."""
    tables = []
    for mazes, prefix, suffix in _maze_sets(results):
        chosen = [result for result in results if (result.setting.split, result.setting.mazes) == mazes]
        tables += [
            dataclasses.replace(table, name=prefix + table.name, title=table.title + suffix)
            for table in (*_tables_of(chosen, labels, with_paper=mazes[0] == "eval"), *_pooled_tables(chosen))
        ]
    return [*tables, _overview(results, labels)]


def measure(result: Result, chosen: np.ndarray) -> dict[str, Cell]:
    """The metrics over the `chosen` (`[E]` bool) episodes, with 95 % intervals by a bootstrap over mazes."""
    episodes, count = result.episodes, int(chosen.sum())
    mazes = episodes.maze[chosen]
    cells = {}
    for metric in METRICS:
        values = episodes.values(metric)[chosen]
        interval = success_interval if metric == "success_rate" else bootstrap_interval
        low, high = interval(episodes.success[chosen] if metric == "success_rate" else values, mazes)
        cells[metric] = Cell(float(values.mean()), low, high, count)
    return cells


def at_level(setting: Setting, perturbation: str, level: float = 0.0) -> Setting:
    """`setting` with another strength of a perturbation."""
    changed: dict[str, Any] = {perturbation: level}
    return dataclasses.replace(setting, **changed)


def levels_of(results: Sequence[Result], perturbation: str) -> Iterator[tuple[Setting, list[Result]]]:
    """For each unperturbed setting of which there are results under this perturbation alone: it, and all its levels."""
    bases = sorted(
        {at_level(result.setting, perturbation) for result in results if result.setting.perturbed == (perturbation,)}
    )
    for base in bases:
        yield base, [result for result in results if at_level(result.setting, perturbation) == base]


def common_distances(results: Sequence[Result]) -> list[int]:
    """The distances from start to goal that every result has, in cells; empty for the hierarchical task."""
    if not results or results[0].setting.task == "hierarchical":
        return []
    return sorted(set.intersection(*(set(result.episodes.distance.tolist()) for result in results)))


def chosen_episodes(result: Result, distances: Sequence[int]) -> np.ndarray:
    """`[E]` bool: those at `distances`; all if there are none."""
    episodes = result.episodes
    return np.isin(episodes.distance, distances) if len(distances) else np.ones(len(episodes), dtype=bool)


def format_distances(distances: Sequence[int]) -> str:
    """As "1–5, 8, 10"."""
    runs: list[list[int]] = []
    for distance in distances:
        if runs and runs[-1][-1] == distance - 1:
            runs[-1] = [runs[-1][0], distance]
        else:
            runs.append([distance])
    return ", ".join("–".join(map(str, run)) for run in runs)


def _maze_sets(results: Sequence[Result]) -> Iterator[tuple[tuple[str, tuple[str, ...]], str, str]]:
    """(split, mazes), a prefix for names of files and a suffix for titles; the benchmark's eval mazes first."""
    found = {(result.setting.split, result.setting.mazes) for result in results}
    custom = sorted(mazes for split, mazes in found if split == "custom")
    if ("eval", ()) in found:
        yield ("eval", ()), "", ""
    if ("train", ()) in found:
        yield ("train", ()), "train-", ", on the training mazes"
    for number, mazes in enumerate(custom, 1):
        names = ", ".join(mazes[:3]) + (f" and {len(mazes) - 3} more" if len(mazes) > 3 else "")
        yield ("custom", mazes), f"custom-{number}-", f", on mazes {names}"


def _tables_of(results: Sequence[Result], labels: Sequence[str], with_paper: bool) -> Iterator[Table]:
    plain = [result for result in results if not result.setting.perturbed]
    local = [result for result in plain if result.setting.task == "local"]
    routes = [result for result in plain if result.setting.task == "hierarchical"]
    for size, group in _grouped(local, lambda result: result.setting.size):
        yield _by_distance(f"local-{size}", f"Local navigation, {size} × {size}", group, labels, with_paper)
    default = [result for result in routes if result.setting.landmark_distance == _DEFAULT_LANDMARKS]
    for task, group in (("local", local), ("hierarchical", default)):
        if len({result.setting.size for result in group}) > 1:
            title = f"{task.capitalize()} navigation by size of the maze"
            yield _by_level(f"size-{task}", title, "cells a side", group, lambda result: result.setting.size, labels)
    for size, group in _grouped(routes, lambda result: result.setting.size):
        yield _by_landmark_distance(int(size), group, labels, with_paper)
    for perturbation in PERTURBATIONS:
        for base, group in levels_of(results, perturbation):
            yield from _perturbation_tables(perturbation, base, group, labels, with_paper)


def _by_distance(
    name: str, title: str, results: Sequence[Result], labels: Sequence[str], with_paper: bool, warped: bool = False
) -> Table:
    distances = sorted({distance for result in results for distance in result.episodes.distance.tolist()})
    common = common_distances(results)
    masks: list[Callable[[Result], np.ndarray]] = [lambda result, d=d: result.episodes.distance == d for d in distances]  # type: ignore[misc]
    rows = [str(distance) for distance in distances]
    if len(common) > 1:
        masks.append(lambda result: chosen_episodes(result, common))
        rows.append(format_distances(common))
    columns = [
        Column(label, False, _cells([measure(result, mask(result)) if mask(result).any() else {} for mask in masks]))
        for label, result in _labelled(results, labels)
    ]
    size = results[0].setting.size
    paper = paper_columns("local", size, distances, len(rows), warped) if with_paper else []
    note = "Distance from start to goal in cells."
    return Table(name, title, note, "distance", tuple(rows), tuple(map(float, distances)), (*columns, *paper))


def _by_landmark_distance(size: int, results: Sequence[Result], labels: Sequence[str], with_paper: bool) -> Table:
    table = _by_level(
        f"hierarchical-{size}",
        f"Hierarchical navigation, {size} × {size}",
        "landmark distance",
        results,
        lambda result: result.setting.landmark_distance,
        labels,
    )
    paper = paper_columns("hierarchical", size, table.x, len(table.rows)) if with_paper else []
    return dataclasses.replace(table, note="Cells from landmark to landmark.", columns=(*table.columns, *paper))


def _perturbation_tables(
    perturbation: str, base: Setting, results: Sequence[Result], labels: Sequence[str], with_paper: bool
) -> Iterator[Table]:
    kind = perturbation.removeprefix("map_").removeprefix("position_")
    place = f"{base.task}-{base.size}" + ("" if _is_default(base) else f"-k{base.landmark_distance}")
    yield _by_level(
        f"{kind}-{place}",
        f"{LEVEL_NAMES[perturbation].partition(' (')[0].capitalize()}: {base}",
        LEVEL_NAMES[perturbation],
        results,
        lambda result: getattr(result.setting, perturbation),
        labels,
    )
    if perturbation != "map_warp" or base.task != "local":
        return
    for level, group in _grouped(results, lambda result: result.setting.map_warp):
        if level:
            title = f"Local navigation, {base.size} × {base.size}, on maps warped by up to {level:g} of their side"
            yield _by_distance(f"warp-{level:g}-{place}", title, group, labels, with_paper, warped=True)


def _pooled_tables(results: Sequence[Result]) -> Iterator[Table]:
    """For each task, size and perturbation of which an agent has several training runs: all such agents."""
    for kind in sorted({_any_landmarks(result.setting) for result in results}):
        agents = training_runs([result for result in results if _any_landmarks(result.setting) == kind])
        if not agents:
            continue
        row_name, rows = _pooled_rows([result for runs in agents.values() for result in runs])
        columns = [column for agent, runs in agents.items() for column in pool_columns(agent, runs, [*rows.values()])]
        if any(any(column.cells["success_rate"]) for column in columns):
            levels = "".join(f"-{name.rpartition('_')[2]}-{getattr(kind, name):g}" for name in kind.perturbed)
            parts = [f"{kind.task.capitalize()} navigation, {kind.size} × {kind.size}"]
            parts += [f"{LEVEL_NAMES[name]} {getattr(kind, name):g}" for name in kind.perturbed]
            title = ", ".join([*parts, "pooled over training runs"])
            yield Table(f"pooled-{kind.task}-{kind.size}{levels}", title, NOTE, row_name, (*rows,), (), (*columns,))


def _any_landmarks(setting: Setting) -> Setting:
    return dataclasses.replace(setting, landmark_distance=0)


def _pooled_rows(results: Sequence[Result]) -> tuple[str, dict[str, Callable[[Result], np.ndarray]]]:
    """What the rows differ in, and each one's name and episodes (`[E]` bool)."""
    rows: dict[str, Callable[[Result], np.ndarray]]
    if results[0].setting.task == "hierarchical":
        levels = sorted({result.setting.landmark_distance for result in results})
        rows = {str(level): lambda result, k=level: _all_if(result, k) for level in levels}  # type: ignore[misc]
        return "landmark distance", rows
    distances = sorted({distance for result in results for distance in result.episodes.distance.tolist()})
    rows = {str(distance): lambda result, d=distance: result.episodes.distance == d for distance in distances}  # type: ignore[misc]
    common = common_distances(results)
    if len(common) > 1:
        rows[format_distances(common)] = lambda result: chosen_episodes(result, common)
    return "distance", rows


def _all_if(result: Result, landmark_distance: int) -> np.ndarray:
    return np.full(len(result.episodes), result.setting.landmark_distance == landmark_distance)


def _is_default(base: Setting) -> bool:
    return base.task == "local" or base.landmark_distance == _DEFAULT_LANDMARKS


def _by_level(
    name: str,
    title: str,
    row_name: str,
    results: Sequence[Result],
    level: Callable[[Result], float],
    labels: Sequence[str],
) -> Table:
    """A row for each level, over the distances that all results have in common."""
    distances = common_distances(results)
    levels = sorted({level(result) for result in results})
    columns = []
    for label in labels:
        by_level = {level(result): result for result in results if result.label == label}
        cells = [by_level.get(row) for row in levels]
        if by_level:
            columns.append(
                Column(label, False, _cells([measure(r, chosen_episodes(r, distances)) if r else {} for r in cells]))
            )
    note = f"Distances {format_distances(distances)}." if distances else ""
    if results[0].setting.task == "local" and not distances:
        note = "Each over the distances that it was evaluated at: there are none in common."
    rows = tuple(f"{row:g}" for row in levels)
    return Table(name, title, note, row_name, rows, tuple(map(float, levels)), tuple(columns))


def _overview(results: Sequence[Result], labels: Sequence[str]) -> Table:
    settings = sorted({result.setting for result in results})
    common = {setting: common_distances([r for r in results if r.setting == setting]) for setting in settings}
    columns = []
    for label in labels:
        by_setting = {result.setting: result for result in results if result.label == label}
        chosen = [(by_setting.get(setting), common[setting]) for setting in settings]
        columns.append(
            Column(label, False, _cells([measure(r, chosen_episodes(r, d)) if r else {} for r, d in chosen]))
        )
    rows = tuple(_overview_row(setting, common[setting], settings, results) for setting in settings)
    note = "All episodes of each result; where results have other distances, those at the distances that all have."
    return Table("all", "All results", note, "setting", rows, (), tuple(columns))


def _overview_row(
    setting: Setting, common: Sequence[int], settings: Sequence[Setting], results: Sequence[Result]
) -> str:
    """The setting's name, with what tells it from others and which episodes count."""
    parts = [str(setting)]
    if setting.mazes and sum(str(other) == str(setting) for other in settings) > 1:
        parts.append(setting.mazes[0] + (" and others" if len(setting.mazes) > 1 else ""))
    if any(set(r.episodes.distance.tolist()) != set(common) for r in results if r.setting == setting and common):
        parts.append(f"distances {format_distances(common)}")
    elif setting.task == "local" and not common:
        parts.append("no distances in common")
    return ", ".join(parts)


def _cells(rows: Sequence[dict[str, Cell]]) -> dict[str, tuple[Cell | None, ...]]:
    return {metric: tuple(row.get(metric) for row in rows) for metric in METRICS}


def _labelled(results: Sequence[Result], labels: Sequence[str]) -> Iterator[tuple[str, Result]]:
    for label in labels:
        yield from ((label, result) for result in results if result.label == label)


def _grouped(results: Iterable[Result], key: Callable[[Result], float]) -> Iterator[tuple[float, list[Result]]]:
    results = list(results)
    for value in sorted({key(result) for result in results}):
        yield value, [result for result in results if key(result) == value]
