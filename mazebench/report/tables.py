"""The report's tables: which episodes stand in which."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator

import pandas as pd

from mazebench.report.frame import (
    DISTANCES_NOTE,
    Rows,
    at_common_distances,
    common_distances,
    facts_of,
    format_distances,
    note_on_distances,
    rows_by,
    rows_by_distance,
    rows_by_level,
    settings_of,
)
from mazebench.report.measures import make_table, paper_columns
from mazebench.report.pooling import pooled_tables
from mazebench.report.settings import DEFAULT_LANDMARK_DISTANCE, Setting, level_help, level_name, short_name
from mazebench.report.table import Table
from mazebench.tasks.tracks import TRACKS


def build_tables(episodes: pd.DataFrame) -> list[Table]:
    """Returns all tables that the episodes of `frame.join_episodes` can fill."""
    tables = []
    for here, prefix, suffix in maze_sets(episodes):
        tables += [
            dataclasses.replace(table, name=prefix + table.name, title=table.title + suffix)
            for table in (*_tables_of(here), *pooled_tables(here))
        ]
    return [*tables, *_split_tables(episodes), _overview(episodes)]


def maze_sets(episodes: pd.DataFrame) -> Iterator[tuple[pd.DataFrame, str, str]]:
    """Yields the episodes of each set of mazes, a prefix for names of files, and a suffix for titles; eval first."""
    sets: dict[tuple[str, tuple[str, ...], tuple[str, ...]], list[Setting]] = {}
    for setting in settings_of(episodes):
        sets.setdefault((setting.split, setting.mazes, setting.own), []).append(setting)
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


def perturbed_groups(episodes: pd.DataFrame) -> Iterator[tuple[str, Setting, pd.DataFrame]]:
    """Yields each perturbation, a setting without it, and the episodes of that setting at all levels.

    The column `strength` has the level of the perturbation. Only settings without other perturbations count, and only
    agents that have results with the perturbation.
    """
    settings = settings_of(episodes)
    alone = [setting for setting in settings if len(setting.perturbations) == 1]
    for perturbation, base in sorted({(name, each.without(name)) for each in alone for name, _ in each.perturbations}):
        levels = {
            setting: setting.level_of(perturbation) for setting in settings if setting.without(perturbation) == base
        }
        group = episodes[episodes.setting.isin(levels)]
        group = group.assign(strength=group.setting.astype(object).map(levels))
        yield perturbation, base, group[group.label.isin(group.label[group.strength > 0])]


def _tables_of(episodes: pd.DataFrame) -> Iterator[Table]:
    plain = episodes[episodes.is_exact]
    local = plain[plain.task == "local"]
    routes = plain[plain.task == "hierarchical"]
    usual_routes = routes[routes.landmark_distance == DEFAULT_LANDMARK_DISTANCE]
    for size, group in local.groupby("size"):
        yield _by_distance(f"local-{size}", f"Local navigation, {size} × {size}", group)
    for task, group in (("local", local), ("hierarchical", usual_routes)):
        if group["size"].nunique() > 1:
            rows = rows_by(group, "size")
            title = f"{task.capitalize()} navigation by size of the maze"
            note = note_on_distances(group)
            yield make_table(f"size-{task}", title, note, "cells a side", rows, _positions(rows))
    for size, group in routes.groupby("size"):
        yield _by_landmark_distance(size, group)
    for perturbation, base, group in perturbed_groups(episodes):
        rows = rows_by(group, "strength", "{:g}".format)
        name, note = level_name(perturbation), f"{level_help(perturbation)} {note_on_distances(group)}".strip()
        title = f"{name.capitalize()}: {base}"
        x = sorted(group.strength.unique())
        yield make_table(f"{short_name(perturbation)}-{base.place}", title, note, name, rows, x)
        # The paper prints local navigation on warped maps by distance.
        if (perturbation, base.task) == ("map_warp", "local"):
            for level, warped in group[group.strength > 0].groupby("strength"):
                title = f"Local navigation, {base.size} × {base.size}, on maps warped by up to {level:g} of their side"
                yield _by_distance(f"warp-{level:g}-{base.place}", title, warped, is_warped=True)
    yield from _track_tables(episodes)


def _by_distance(name: str, title: str, episodes: pd.DataFrame, is_warped: bool = False) -> Table:
    """Returns the table of one setting."""
    rows = rows_by_distance(episodes)
    distances = sorted(episodes.distance.unique())
    setting = episodes.setting.iloc[0]
    is_comparable = setting.split == "eval" and not setting.senses
    paper = paper_columns("local", setting.size, distances, len(rows), is_warped) if is_comparable else []
    note = "Distance from start to goal in cells."
    return make_table(name, title, note, "distance", rows, list(map(float, distances)), paper)


def _by_landmark_distance(size: int, episodes: pd.DataFrame) -> Table:
    rows = rows_by(episodes, "landmark_distance")
    setting = episodes.setting.iloc[0]
    is_comparable = setting.split == "eval" and not setting.senses
    paper = paper_columns("hierarchical", size, _positions(rows), len(rows)) if is_comparable else []
    title, note = f"Hierarchical navigation, {size} × {size}", "Cells from landmark to landmark."
    return make_table(f"hierarchical-{size}", title, note, "landmark distance", rows, _positions(rows), paper)


def _track_tables(episodes: pd.DataFrame) -> Iterator[Table]:
    """Yields a table of all tracks, with a row for each track and level, and a table of each track."""
    groups = {name: group for name in TRACKS if len(group := episodes[episodes.track == name])}
    levels = {name: rows_by_level(group) for name, group in groups.items()}
    if groups:
        rows = {f"{name} {level}": row for name in groups for level, row in levels[name].items()}
        yield make_table("tracks", "Tracks", DISTANCES_NOTE, "track and level", rows)
    for name, group in groups.items():
        meanings = "; ".join(f"{level}: {TRACKS[name].levels[int(level) - 1]}" for level in levels[name])
        of_facts = {
            f"{level}, {fact}": row[row[fact]] for level, row in levels[name].items() for fact in facts_of(group)
        }
        note = f"{TRACKS[name].help} {meanings}."
        rows = levels[name] | of_facts
        yield make_table(f"track-{name}", f"Track {name}", note, "level", rows, _positions(levels[name]))


def _split_tables(episodes: pd.DataFrame) -> Iterator[Table]:
    """Yields a table of training against eval mazes for each unperturbed setting in which an agent has both."""
    pairs: dict[Setting, list[Setting]] = {}
    for setting in settings_of(episodes):
        if setting.split in ("train", "eval") and not (setting.perturbations or setting.senses):
            pairs.setdefault(dataclasses.replace(setting, split="eval"), []).append(setting)
    for base in sorted(pairs):
        group = episodes[episodes.setting.isin(pairs[base])]
        group = group[group.groupby("label", observed=True).split.transform("nunique") == 2]
        if len(group):
            by_split = rows_by(group, "split")
            rows = {"train": by_split["train"], "eval": by_split["eval"]}
            name, title = f"splits-{base.place}", f"Training against eval mazes: {base}"
            yield make_table(name, title, note_on_distances(group), "split", rows, (0.0, 1.0))


def _overview(episodes: pd.DataFrame) -> Table:
    """Returns the table of all results: a row for each setting."""
    rows: Rows = {}
    names = [str(setting) for setting in settings_of(episodes)]
    for setting, group in episodes.groupby("setting", observed=True):
        rows[_setting_in_words(setting, group, names.count(str(setting)) > 1)] = at_common_distances(group)
    return make_table("all", "All results", DISTANCES_NOTE, "setting", rows)


def _setting_in_words(setting: Setting, episodes: pd.DataFrame, has_namesake: bool) -> str:
    """Returns the setting with what tells it from others and which episodes count."""
    parts = [str(setting)]
    if has_namesake and setting.mazes:
        parts.append(setting.mazes[0] + (f" and {len(setting.mazes) - 1} more" if len(setting.mazes) > 1 else ""))
    common = common_distances(episodes)
    if common and episodes.distance.nunique() > len(common):
        parts.append(f"distances {format_distances(common)}")
    elif setting.task == "local" and not common:
        parts.append("no distances in common")
    return ", ".join(parts)


def _positions(rows: Rows) -> list[float]:
    """Returns where rows that are called after numbers lie on an axis."""
    return list(map(float, rows))
