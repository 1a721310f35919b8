"""The report's tables: which episodes stand in which row, and the means of each agent in it."""

from __future__ import annotations

import dataclasses
import itertools
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import pandas as pd

from mazebench.options import fields_of
from mazebench.report.episodes import at_common_distances, common_distances, facts_of, settings_of
from mazebench.report.table import METRICS, UNTRAINED_NOTE, Table, make_values
from mazebench.results.intervals import Estimate, mean_interval, pool_runs
from mazebench.results.paper import printed
from mazebench.tasks.task_options import CUSTOM, TaskOptions
from mazebench.tasks.tracks import TRACKS

DEFAULT_LANDMARK_DISTANCE = 5  # cells; the paper's choice wherever it varies something else
Rows = dict[str, pd.DataFrame]  # named groups of the episodes of all agents

_DISTANCES_NOTE = (
    "Means over all episodes. If results cover different distances, only the distances that all of them cover count."
)
_POOLED_NOTE = (
    "Mean and interquartile mean (IQM) of the mazes' scores in all training runs. 95 % intervals by a bootstrap over "
    "whole runs: they are of other training runs on these mazes, and with fewer than 5 runs they are too narrow. Empty "
    "without two runs of the same episodes."
)


def build_tables(episodes: pd.DataFrame) -> list[Table]:
    """Returns all tables that the episodes of `join_episodes` can fill."""
    tables = []
    for here, prefix, suffix in maze_sets(episodes):
        tables += [
            dataclasses.replace(table, name=prefix + table.name, title=table.title + suffix)
            for table in (*_tables_of(here), *_pooled_tables(here))
        ]
    return [*tables, _overview(episodes)]


def make_table(
    name: str,
    title: str,
    note: str,
    row_name: str,
    rows: Rows,
    x: Mapping[str, float] | None = None,
    paper: Mapping[str, Mapping[str, Mapping[int, float]]] | None = None,
) -> Table:
    """Returns a table with a column for each agent that has episodes in a row, and the paper's columns behind them.

    Args:
      name, title, note, row_name, x: of the table.
      rows: the episodes of each row.
      paper: printed values by agent, metric and row, of the rows in `x`.
    """
    lines: list[dict[str, Any]] = []
    for row, episodes in rows.items():
        for label, own in episodes.groupby("label", observed=True):
            mark = "*" if own.is_untrained.iloc[0] else ""
            for metric, mean in measure(own).items():
                lines.append(_line(metric, row, label, mean, len(own)) | {"source": "measured", "mark": mark})
    columns = sorted({line["column"] for line in lines}, key=episodes.label.cat.categories.get_loc)
    for agent, metrics in (paper or {}).items():
        for (metric, values), row in itertools.product(metrics.items(), x or ()):
            if int(float(row)) in values:
                value = values[int(float(row))]
                lines.append(
                    {"metric": metric, "row": row, "column": f"{agent} (paper)", "source": "paper", "value": value}
                )
        if lines[-1]["column"] == f"{agent} (paper)":
            columns.append(f"{agent} (paper)")
    if any(line.get("mark") for line in lines):
        note = f"{note} {UNTRAINED_NOTE}".strip()
    return Table(name, title, note, row_name, make_values(lines, rows, columns), x or {})


def measure(episodes: pd.DataFrame) -> dict[str, Estimate]:
    """Returns the metrics that are known of episodes of one result, at least one, with 95 % intervals."""
    return {
        metric: mean_interval(episodes[metric].to_numpy(), episodes.maze_index.to_numpy())
        for metric in METRICS
        if not episodes[metric].isna().any()  # the oracle's steps are not known
    }


def maze_sets(episodes: pd.DataFrame) -> Iterator[tuple[pd.DataFrame, str, str]]:
    """Yields the episodes of each set of mazes, a prefix for names of files, and a suffix for titles; eval first."""
    sets: dict[tuple[str, tuple[str, ...], tuple[str, ...]], list[TaskOptions]] = {}
    for setting, group in episodes.groupby("setting", observed=True):
        split = setting.split_in_results
        names = tuple(sorted(group.maze.unique())) if split == CUSTOM else ()
        sets.setdefault((split, names, setting.own_in_words), []).append(setting)
    num_custom = 0
    for split, mazes, own in sorted(sets, key=lambda key: (("eval", "dev", "train", "custom").index(key[0]), *key[1:])):
        prefix, suffix = "", ""
        if split in ("dev", "train"):
            prefix, suffix = f"{split}-", f", on the {split} mazes"
        if split == "custom":
            num_custom += 1
            more = f" and {len(mazes) - 3} more" if len(mazes) > 3 else ""
            suffix = ", ".join(("", f"on mazes {', '.join(mazes[:3])}{more}", *own))
            prefix = f"custom-{num_custom}-"
        elif own:
            suffix = ", ".join((suffix, *own))
            prefix += re.sub(r"[^a-z0-9.]+", "-", "-".join(own)) + "-"
        yield episodes[episodes.setting.isin(sets[split, mazes, own])], prefix, suffix


def perturbed_groups(episodes: pd.DataFrame) -> Iterator[tuple[str, TaskOptions, pd.DataFrame]]:
    """Yields each perturbation, a setting without it, and the episodes of that setting at all levels.

    The column `strength` has the level of the perturbation. Only settings without other perturbations count, and only
    agents that have results with the perturbation.
    """
    settings = settings_of(episodes)
    pairs = [(name, each) for each in settings for name, _ in each.active_perturbations]
    alone = {(name, _without(each, name)) for name, each in pairs if len(each.active_perturbations) == 1}
    for perturbation, base in sorted(alone):
        levels = {each: each.perturbations[perturbation] for each in settings if _without(each, perturbation) == base}
        group = episodes[episodes.setting.isin(levels)]
        group = group.assign(strength=group.setting.astype(object).map(levels))
        yield perturbation, base, group[group.label.isin(group.label[group.strength > 0])]


def _without(setting: TaskOptions, perturbation: str) -> TaskOptions:
    return setting.replace(**{perturbation: 0.0})


def level_name(perturbation: str) -> str:
    """Returns the name of a perturbation in words."""
    return perturbation.replace("_", " ")


def level_help(perturbation: str) -> str:
    """Returns in a sentence what a level means."""
    return fields_of(TaskOptions)[perturbation].help


def perturbed_name(perturbation: str, base: TaskOptions) -> str:
    """Returns the name of files on the levels of a perturbation in a setting that is else `base`."""
    is_usual = base.landmark_distance == DEFAULT_LANDMARK_DISTANCE
    return f"{perturbation.rpartition('_')[2]}-{base.slug}" + ("" if is_usual else f"-k{base.landmark_distance}")


def format_distances(distances: Sequence[int]) -> str:
    """Returns distances as "1–5, 8, 10"."""
    runs: list[list[int]] = []
    for distance in distances:
        if runs and runs[-1][-1] == distance - 1:
            runs[-1] = [runs[-1][0], distance]
        else:
            runs.append([distance])
    return ", ".join("–".join(map(str, run)) for run in runs)


def note_on_distances(episodes: pd.DataFrame) -> str:
    """Returns in a sentence which distances count where results of several settings are compared."""
    if episodes.task.eq("hierarchical").any():
        return ""
    distances = common_distances(episodes)
    if not distances:
        return "The results have no distance in common: each value is over all distances of its result."
    return f"Distances {format_distances(distances)}."


def _tables_of(episodes: pd.DataFrame) -> Iterator[Table]:
    plain = episodes[episodes.is_exact]
    local = plain[plain.task == "local"]
    routes = plain[plain.task == "hierarchical"]
    usual_routes = routes[routes.landmark_distance == DEFAULT_LANDMARK_DISTANCE]
    for size, group in local.groupby("size"):
        yield _by_distance(f"local-{size}", f"Local navigation, {size} × {size}", group)
    for task, group in (("local", local), ("hierarchical", usual_routes)):
        if group["size"].nunique() > 1:
            rows = _rows_by(group, "size")
            title = f"{task.capitalize()} navigation by size of the maze"
            yield make_table(f"size-{task}", title, note_on_distances(group), "cells a side", rows, _positions(rows))
    for size, group in routes.groupby("size"):
        rows = _rows_by(group, "landmark_distance")
        title, note = f"Hierarchical navigation, {size} × {size}", "Cells from landmark to landmark."
        paper = printed("hierarchical", size) if _is_printed(group) else None
        yield make_table(f"hierarchical-{size}", title, note, "landmark distance", rows, _positions(rows), paper)
    for perturbation, base, group in perturbed_groups(episodes):
        rows = _rows_by(group, "strength", "{:g}".format)
        name, note = level_name(perturbation), f"{level_help(perturbation)} {note_on_distances(group)}".strip()
        title = f"{name.capitalize()}: {base}"
        yield make_table(perturbed_name(perturbation, base), title, note, name, rows, _positions(rows))
        # The paper prints local navigation on warped maps by distance.
        if (perturbation, base.task) == ("map_warp", "local"):
            for level, warped in group[group.strength > 0].groupby("strength"):
                title = f"Local navigation, {base.size} × {base.size}, on maps warped by up to {level:g} of their side"
                yield _by_distance(f"warp-{level:g}-{base.slug}", title, warped, is_warped=True)
    yield from _track_tables(episodes)


def _by_distance(name: str, title: str, episodes: pd.DataFrame, is_warped: bool = False) -> Table:
    """Returns the table of one setting."""
    rows = _rows_by_distance(episodes)
    x = {str(distance): float(distance) for distance in sorted(episodes.distance.unique())}
    paper = printed("local", int(episodes["size"].iloc[0]), is_warped) if _is_printed(episodes) else None
    return make_table(name, title, "Distance from start to goal in cells.", "distance", rows, x, paper)


def _is_printed(episodes: pd.DataFrame) -> bool:
    """Returns whether the paper's values can stand beside those of episodes of one setting."""
    setting = episodes.setting.iloc[0]
    return setting.split_in_results == "eval" and not setting.own_in_words


def _track_tables(episodes: pd.DataFrame) -> Iterator[Table]:
    """Yields a table of all tracks, with a row for each track and level, and a table of each track."""
    groups = {name: group for name in TRACKS if len(group := episodes[episodes.track == name])}
    levels = {name: _rows_by_level(group) for name, group in groups.items()}
    if groups:
        rows = {f"{name} {level}": row for name in groups for level, row in levels[name].items()}
        yield make_table("tracks", "Tracks", _DISTANCES_NOTE, "track and level", rows)
    for name, group in groups.items():
        meanings = "; ".join(f"{level}: {TRACKS[name].levels[int(level) - 1].meaning}" for level in levels[name])
        of_facts = {
            f"{level}, {fact}": row[row[fact]] for level, row in levels[name].items() for fact in facts_of(group)
        }
        note = f"{TRACKS[name].help} {meanings}."
        yield make_table(
            f"track-{name}", f"Track {name}", note, "level", levels[name] | of_facts, _positions(levels[name])
        )


def _overview(episodes: pd.DataFrame) -> Table:
    """Returns the table of all results: a row for each setting."""
    rows: Rows = {}
    names = [str(setting) for setting in settings_of(episodes)]
    for setting, group in episodes.groupby("setting", observed=True):
        rows[_setting_in_words(setting, group, names.count(str(setting)) > 1)] = at_common_distances(group)
    return make_table("all", "All results", _DISTANCES_NOTE, "setting", rows)


def _setting_in_words(setting: TaskOptions, episodes: pd.DataFrame, has_namesake: bool) -> str:
    """Returns the setting with what tells it from others and which episodes count."""
    parts = [str(setting)]
    if has_namesake and setting.split_in_results == CUSTOM:
        first, *others = sorted(episodes.maze.unique())
        parts.append(first + (f" and {len(others)} more" if others else ""))
    common = common_distances(episodes)
    if common and episodes.distance.nunique() > len(common):
        parts.append(f"distances {format_distances(common)}")
    elif not setting.is_hierarchical and not common:
        parts.append("no distances in common")
    return ", ".join(parts)


def _pooled_tables(episodes: pd.DataFrame) -> Iterator[Table]:
    """Yields a table over training runs for each task, size and perturbation, or track, of which an agent has several.

    A run is a checkpoint, or a seed where there is none. A checkpoint evaluated with several seeds is one run: the
    lowest seed counts.
    """
    ordered = episodes.sort_values("run_seed", kind="stable")
    ordered = ordered[ordered.result.isin(ordered.drop_duplicates(["agent", "setting", "run"]).result)]
    kinds = ordered.setting.astype(object).map(_kind)
    for kind, group in ordered.groupby(kinds):
        runs = group[group.groupby("agent").run.transform("nunique") > 1]
        if not len(runs):
            continue
        row_name, rows = "landmark distance", _rows_by(runs, "landmark_distance")
        what = f"{kind.task.capitalize()} navigation, {kind.size} × {kind.size}"
        if kind.track:
            what, row_name, rows = f"Track {kind.track}", "level", _rows_by_level(runs)
        elif not kind.is_hierarchical:
            row_name, rows = "distance", _rows_by_distance(runs)
        lines = [line for row, own in rows.items() for metric in METRICS for line in _pool(own, metric, row)]
        if lines:
            parts = [what, *(f"{level_name(name)} {level:g}" for name, level in kind.active_perturbations)]
            title = ", ".join([*parts, "pooled over training runs"])
            values = make_values(lines, rows, dict.fromkeys(line["column"] for line in lines))
            yield Table(f"pooled-{kind.track or kind.slug}", title, _POOLED_NOTE, row_name, values)


def _kind(setting: TaskOptions) -> TaskOptions:
    """Returns what all rows of a pooled table have in common."""
    if setting.track is not None:
        return setting.replace(size=None, level=None)
    return setting.replace(landmark_distance=DEFAULT_LANDMARK_DISTANCE)


def _pool(episodes: pd.DataFrame, metric: str, row: str) -> Iterator[dict[str, Any]]:
    """Yields each agent's mean and interquartile mean over its training runs."""
    for agent, own in episodes.groupby("agent", sort=False):
        by_run = own.pivot(index="run", columns=["maze_index", "trial"], values=metric).reindex(own.run.unique())
        # Without a value where runs are of other episodes, or the oracle's steps are not known.
        if len(by_run) > 1 and not by_run.isna().any(axis=None):
            scores = by_run.T.groupby("maze_index").mean().T.to_numpy()
            for name, estimate in zip(("mean", "IQM"), pool_runs(scores), strict=True):
                line = _line(metric, row, f"{agent}, {name}", estimate, by_run.size)
                yield line | {"source": "measured", "runs": len(scores)}


def _line(metric: str, row: str, column: str, mean: Estimate, num_episodes: int) -> dict[str, Any]:
    interval = {"value": mean.value, "low95": mean.low, "high95": mean.high}
    return {"metric": metric, "row": row, "column": column, "episodes": num_episodes, **interval}


def _rows_by_distance(episodes: pd.DataFrame) -> Rows:
    """Returns a row for each distance from start to goal, and one for all distances that the results have in common."""
    rows = {str(distance): group for distance, group in episodes.groupby("distance")}
    common = common_distances(episodes)
    if len(common) > 1:
        rows[format_distances(common)] = episodes[episodes.distance.isin(common)]
    return rows


def _rows_by(episodes: pd.DataFrame, column: str, name: Callable[[Any], str] = str) -> Rows:
    """Returns a row for each value of a column, with the distances that all results have in common."""
    return {name(value): group for value, group in at_common_distances(episodes).groupby(column)}


def _rows_by_level(episodes: pd.DataFrame) -> Rows:
    """Returns a row for each level of a track, with the distances that all results of this level have in common."""
    return {str(level): at_common_distances(group) for level, group in episodes.groupby("level")}


def _positions(rows: Rows) -> dict[str, float]:
    """Returns where rows that are called after numbers lie on an axis."""
    return {row: float(row) for row in rows}
