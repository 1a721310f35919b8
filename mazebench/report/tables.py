"""The report's tables: which results stand in which."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence

from mazebench.report.measures import make_table
from mazebench.report.overview import overview
from mazebench.report.pooling import pooled_tables
from mazebench.report.reference import paper_columns
from mazebench.report.results import ReportedResult
from mazebench.report.rows import distance_rows, note_on_distances, setting_rows
from mazebench.report.settings import DEFAULT_LANDMARK_DISTANCE, Setting, level_help, level_name, short_name
from mazebench.report.table import Table
from mazebench.report.tracks import track_tables


def build_tables(results: Sequence[ReportedResult], labels: Sequence[str]) -> list[Table]:
    """Returns all tables that `results` can fill, with a column for each of `labels` that has a result in them."""
    tables = []
    for chosen, prefix, suffix in maze_sets(results):
        tables += [
            dataclasses.replace(table, name=prefix + table.name, title=table.title + suffix)
            for table in (*_tables_of(chosen, labels), *pooled_tables(chosen))
        ]
    return [*tables, *_split_tables(results, labels), overview(results, labels)]


def maze_sets(results: Sequence[ReportedResult]) -> Iterator[tuple[list[ReportedResult], str, str]]:
    """Yields the results of each set of mazes, a prefix for names of files, and a suffix for titles; eval first."""
    found = {(result.setting.split, result.setting.mazes, result.setting.own) for result in results}
    num_custom = 0
    for split, mazes, own in sorted(found, key=lambda key: (("eval", "train", "custom").index(key[0]), *key[1:])):
        prefix, suffix = {"train": ("train-", ", on the training mazes")}.get(split, ("", ""))
        if split == "custom":
            num_custom += 1
            more = f" and {len(mazes) - 3} more" if len(mazes) > 3 else ""
            suffix = ", ".join(("", f"on mazes {', '.join(mazes[:3])}{more}", *own))
            prefix = f"custom-{num_custom}-"
        here = [r for r in results if (r.setting.split, r.setting.mazes, r.setting.own) == (split, mazes, own)]
        yield here, prefix, suffix


def perturbed_groups(results: Sequence[ReportedResult]) -> Iterator[tuple[str, Setting, list[ReportedResult]]]:
    """Yields each perturbation, a setting without it, and the results of that setting at all levels.

    Only settings without other perturbations count, and only agents that have results with the perturbation.
    """
    settings = [result.setting for result in results if len(result.setting.perturbations) == 1]
    kinds = {(name, setting.without(name)) for setting in settings for name, _ in setting.perturbations}
    for perturbation, base in sorted(kinds):
        group = [result for result in results if result.setting.without(perturbation) == base]
        labels = {result.label for result in group if result.setting != base}
        yield perturbation, base, [result for result in group if result.label in labels]


def _tables_of(results: Sequence[ReportedResult], labels: Sequence[str]) -> Iterator[Table]:
    plain = [result for result in results if result.setting.is_exact]
    local = [result for result in plain if result.setting.task == "local"]
    routes = [result for result in plain if result.setting.task == "hierarchical"]
    usual_routes = [result for result in routes if result.setting.landmark_distance == DEFAULT_LANDMARK_DISTANCE]
    for size in _sizes(local):
        group = [result for result in local if result.setting.size == size]
        yield _by_distance(f"local-{size}", f"Local navigation, {size} × {size}", group, labels)
    for task, group in (("local", local), ("hierarchical", usual_routes)):
        if len(_sizes(group)) > 1:
            names = {float(size): str(size) for size in _sizes(group)}
            rows = setting_rows(group, names, lambda setting: setting.size)
            title = f"{task.capitalize()} navigation by size of the maze"
            note = note_on_distances(group)
            yield make_table(f"size-{task}", title, note, "cells a side", rows, tuple(names), group, labels)
    for size in _sizes(routes):
        yield _by_landmark_distance(size, [result for result in routes if result.setting.size == size], labels)
    for perturbation, base, group in perturbed_groups(results):
        yield _by_level(perturbation, base, group, labels)
        # The paper prints local navigation on warped maps by distance.
        if (perturbation, base.task) == ("map_warp", "local"):
            yield from _by_distance_when_warped(base, group, labels)
    yield from track_tables(results, labels)


def _by_distance(
    name: str, title: str, results: Sequence[ReportedResult], labels: Sequence[str], warped: bool = False
) -> Table:
    rows = distance_rows(results)
    distances = sorted({distance for result in results for distance in result.episodes.distance.tolist()})
    setting = results[0].setting
    paper = paper_columns("local", setting.size, distances, len(rows), warped) if setting.split == "eval" else []
    note = "Distance from start to goal in cells."
    return make_table(name, title, note, "distance", rows, tuple(map(float, distances)), results, labels, paper)


def _by_landmark_distance(size: int, results: Sequence[ReportedResult], labels: Sequence[str]) -> Table:
    names = {float(cells): str(cells) for cells in sorted({result.setting.landmark_distance for result in results})}
    rows = setting_rows(results, names, lambda setting: setting.landmark_distance)
    is_eval = results[0].setting.split == "eval"
    paper = paper_columns("hierarchical", size, tuple(names), len(rows)) if is_eval else []
    title, note = f"Hierarchical navigation, {size} × {size}", "Cells from landmark to landmark."
    name = f"hierarchical-{size}"
    return make_table(name, title, note, "landmark distance", rows, tuple(names), results, labels, paper)


def _by_level(perturbation: str, base: Setting, results: Sequence[ReportedResult], labels: Sequence[str]) -> Table:
    levels = sorted({result.setting.level_of(perturbation) for result in results})
    names = {level: f"{level:g}" for level in levels}
    rows = setting_rows(results, names, lambda setting: setting.level_of(perturbation))
    name = f"{short_name(perturbation)}-{base.place}"
    title = f"{level_name(perturbation).capitalize()}: {base}"
    note = f"{level_help(perturbation)} {note_on_distances(results)}".strip()
    return make_table(name, title, note, level_name(perturbation), rows, tuple(levels), results, labels)


def _by_distance_when_warped(
    base: Setting, results: Sequence[ReportedResult], labels: Sequence[str]
) -> Iterator[Table]:
    for level in sorted({result.setting.level_of("map_warp") for result in results} - {0.0}):
        group = [result for result in results if result.setting.level_of("map_warp") == level]
        title = f"Local navigation, {base.size} × {base.size}, on maps warped by up to {level:g} of their side"
        yield _by_distance(f"warp-{level:g}-{base.place}", title, group, labels, warped=True)


def _split_tables(results: Sequence[ReportedResult], labels: Sequence[str]) -> Iterator[Table]:
    """Yields a table of training against eval mazes for each unperturbed setting in which an agent has both."""
    by_label: dict[tuple[Setting, str], list[ReportedResult]] = {}
    for result in results:
        if result.setting.split in ("train", "eval") and not result.setting.perturbations:
            key = dataclasses.replace(result.setting, split="eval"), result.label
            by_label.setdefault(key, []).append(result)
    for base in sorted({setting for setting, _ in by_label}):
        pairs = [pair for (setting, _), pair in by_label.items() if setting == base and len(pair) == 2]
        if pairs:
            group = [result for pair in pairs for result in pair]
            rows = setting_rows(group, {0.0: "train", 1.0: "eval"}, lambda setting: setting.split == "eval")
            name, title = f"splits-{base.place}", f"Training against eval mazes: {base}"
            yield make_table(name, title, note_on_distances(group), "split", rows, (0.0, 1.0), group, labels)


def _sizes(results: Sequence[ReportedResult]) -> list[int]:
    return sorted({result.setting.size for result in results})
