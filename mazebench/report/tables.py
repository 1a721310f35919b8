"""The report's tables: which episodes stand in which row, and the means of each agent in it."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

import pandas as pd

from mazebench.options import fields_of
from mazebench.report.episodes import at_common_distances, common_distances, facts_of
from mazebench.report.table import Table, make_values
from mazebench.results.intervals import Estimate, mean_interval, runs_interval
from mazebench.results.metrics import METRICS
from mazebench.results.naming import described
from mazebench.results.paper import printed
from mazebench.tasks.perturbations.flip_warp_noise import PERTURBATIONS
from mazebench.tasks.task_options import TaskOptions
from mazebench.tasks.tracks import TRACKS

DEFAULT_LANDMARK_DISTANCE = 5  # cells; the paper's choice wherever it varies something else
Rows = dict[str, pd.DataFrame]  # named groups of the episodes of all agents
Printed = Mapping[str, Mapping[str, Mapping[str, float]]]  # the paper's values by agent, metric and row
FINER = ": "  # between a setting and what is counted of it alone

_DISTANCES_NOTE = "Where results cover different distances, only the distances that all of them cover count."
_UNTRAINED_NOTE = "* The agent was never trained on maps of this scale."


def build_tables(episodes: pd.DataFrame) -> list[Table]:
    """Returns all tables that the episodes of `join_episodes` can fill."""
    tables = list(_tables_of(episodes[episodes.mazes == ""]))
    for number, mazes in enumerate(sorted(set(episodes.mazes) - {""}), 1):
        tables += [
            dataclasses.replace(table, name=f"{table.name}-mazes-{number}", title=f"{table.title}, {mazes}")
            for table in _tables_of(episodes[episodes.mazes == mazes])
        ]
    return [*tables, _all_settings(episodes)]


def _all_settings(episodes: pd.DataFrame) -> Table:
    """Returns a table with a row for each setting, followed by its distances, or by the groups that a track tells."""
    rows: Rows = {}
    is_cut = False
    paper: dict[str, dict[str, dict[str, float]]] = {}
    settings = list(episodes.groupby("setting", observed=True))
    names = Counter(described(setting) for setting, _ in settings)
    for setting, group in settings:
        name = described(setting) + f", {group.mazes.iloc[0]}" * (names[described(setting)] > 1)
        rows[name] = at_common_distances(group)
        is_cut |= len(rows[name]) < len(group)
        finer = {fact: group[group[fact]] for fact in facts_of(group)}
        if setting.track is None and not setting.is_hierarchical:
            finer = {f"distance {distance}": own for distance, own in group.groupby("distance")}
        rows |= {f"{name}{FINER}{each}": own for each, own in finer.items() if len(own)}

        # The paper prints local navigation by distance, on right and on warped maps, and routes by landmark distance.
        perturbed = {each for each, _ in setting.active_perturbations}
        is_printed = setting.track is None and perturbed <= {"map_warp"} and not (perturbed and setting.is_hierarchical)
        task, own_row = group.task.iloc[0], {str(setting.landmark_distance): name}
        for agent, metrics in (_printed(task, group, bool(perturbed)) if is_printed else {}).items():
            for metric, values in metrics.items():
                keys = own_row if setting.is_hierarchical else {at: f"{name}{FINER}distance {at}" for at in values}
                found = paper.setdefault(agent, {}).setdefault(metric, {})
                found |= {keys[at]: value for at, value in values.items() if at in keys}
    return make_table("all", "All results", _DISTANCES_NOTE if is_cut else "", "setting", rows, paper)


def make_table(name: str, title: str, note: str, row_name: str, rows: Rows, paper: Printed | None = None) -> Table:
    """Returns a table with a column for each agent, then one for each mean over training runs, then the paper's."""
    lines: list[dict[str, Any]] = []
    episodes = pd.concat(rows, names=["row"]).reset_index("row")
    for (label, row), own in episodes.groupby(["label", "row"], observed=True):
        mark = "*" if own.is_untrained.iloc[0] else ""
        for metric in METRICS:
            if metric not in own or own[metric].isna().any():
                continue  # an agent that reports no poses
            mean = mean_interval(own[metric].to_numpy(), own.maze_index.to_numpy())
            lines.append(_line(metric, row, label, mean, len(own)) | {"mark": mark})
    several = episodes[episodes.groupby("agent").run.transform("nunique") > 1]
    for (agent, row), own in several.groupby(["agent", "row"], sort=False):
        for metric in own.columns.intersection(list(METRICS)):
            runs = own.pivot_table(values=metric, index="run", columns=["maze_index", "trial"])
            if len(runs) > 1 and not runs.isna().any(axis=None):  # runs of the same episodes
                mean = runs_interval(runs.to_numpy(), runs.columns.get_level_values("maze_index").to_numpy())
                lines.append(_line(metric, row, f"{agent}, mean", mean, runs.size) | {"runs": len(runs)})
    for agent, metrics in (paper or {}).items():
        for metric, values in metrics.items():
            named = {"metric": metric, "column": f"{agent} (paper)", "source": "paper"}
            lines += [named | {"row": row, "value": values[row]} for row in rows if row in values]
    if any(line.get("mark") for line in lines):
        note = f"{note} {_UNTRAINED_NOTE}".strip()
    return Table(name, title, note, row_name, make_values(lines, rows))


def perturbed_groups(episodes: pd.DataFrame) -> Iterator[tuple[str, str, pd.DataFrame]]:
    """Yields each perturbation, the name of files on its levels in a setting, and the episodes of that setting.

    The column `strength` has that of the perturbation, also 0. Only agents that have results with the perturbation
    count, and only results without another one.
    """
    is_off = episodes[list(PERTURBATIONS)].eq(0)
    for perturbation in PERTURBATIONS:
        alone = episodes[episodes.track.eq("") & is_off.drop(columns=perturbation).all(axis=1)]
        alone = alone.assign(strength=alone[perturbation])
        for (task, size, landmarks), group in alone.groupby(["task", "size", "landmark_distance"]):
            name = f"{perturbation.rpartition('_')[2]}-{task}-{size}"
            name += f"-k{landmarks}" * (landmarks not in (0, DEFAULT_LANDMARK_DISTANCE))
            if (group.strength > 0).any():
                yield perturbation, name, group[group.label.isin(group.label[group.strength > 0])]


def note_on_levels(perturbation: str, episodes: pd.DataFrame) -> str:
    """Returns what the strength of a perturbation means, and which distances count."""
    distances = common_distances(episodes)
    counted = f"Distances {_format_distances(distances)}." if distances else ""
    return f"{fields_of(TaskOptions)[perturbation].help} {counted}".strip()


def _tables_of(episodes: pd.DataFrame) -> Iterator[Table]:
    """Yields the tables of one set of mazes."""
    plain = episodes[episodes.is_exact]
    local, routes = plain[plain.task == "local"], plain[plain.task == "hierarchical"]
    for size, group in local.groupby("size"):
        yield _by_distance(f"local-{size}", f"Local navigation, {size} × {size}", group)
    if local["size"].nunique() > 1:
        title = "Local navigation by size of the maze"
        yield make_table("size-local", title, _DISTANCES_NOTE, "cells a side", _rows_by(local, "size"))
    for size, group in routes.groupby("size"):
        title, note = f"Hierarchical navigation, {size} × {size}", "Cells from landmark to landmark."
        rows = _rows_by(group, "landmark_distance")
        yield make_table(
            f"hierarchical-{size}", title, note, "landmark distance", rows, _printed("hierarchical", group)
        )
    for perturbation, name, group in perturbed_groups(episodes):
        strength_name, (task, size) = perturbation.replace("_", " "), group[["task", "size"]].iloc[0]
        title = f"{strength_name.capitalize()}: {task}, {size} × {size}"
        rows, note = _rows_by(group, "strength"), note_on_levels(perturbation, group)
        yield make_table(name, title, note, strength_name, rows)
        # The paper prints local navigation on warped maps by distance.
        if (perturbation, task) == ("map_warp", "local"):
            for level, warped in group[group.strength > 0].groupby("strength"):
                title = f"Local navigation, {size} × {size}, on maps warped by up to {level:g} of their side"
                yield _by_distance(f"warp-{level:g}-local-{size}", title, warped, is_warped=True)

    # A table of all tracks, with a row for each track and level, and a table of each track and number of goals.
    rows, tables = {}, []
    for name in TRACKS:
        for number, group in episodes[episodes.track == name].groupby("num_goals"):
            goals = f", {number} goals" if number > 1 else ""
            own = {str(level): at_common_distances(each) for level, each in group.groupby("level")}
            of_facts = {f"{level}, {fact}": row[row[fact]] for level, row in own.items() for fact in facts_of(group)}
            file = f"track-{name}{goals.replace(', ', '-').replace(' ', '-')}"
            tables.append(make_table(file, f"Track {name}{goals}", _track_note(group), "level", own | of_facts))
            rows |= {f"{name} {level}{goals}": row for level, row in own.items()}
    if rows:
        yield make_table("tracks", "Tracks", _DISTANCES_NOTE, "track and level", rows)
    yield from tables


def _track_note(episodes: pd.DataFrame) -> str:
    """Returns what is imperfect in the episodes of a track; in other buildings than the track's, as it was counted."""
    setting, track = episodes.setting.iloc[0], TRACKS[episodes.track.iloc[0]]
    levels = dict(list(episodes.groupby("level")))
    if setting.mazes is None or "blocked" not in episodes:
        return " ".join([track.help, *(f"Level {level}: {track.levels[level - 1].meaning}." for level in levels)])
    if setting.shown not in (None, setting.mazes):
        lines = ["The agents are shown an older map of each building."]
    else:
        lines = ["Doors have moved since the map was drawn." if episodes.blocked.any() else "The map is right."]
    if episodes.blocked.any():
        counts = ", ".join(f"level {level}: {own.blocked.mean():.2f}" for level, own in levels.items())
        lines.append(f"The shortest path on the map is blocked in a share of the episodes ({counts}).")
    return " ".join(lines + ["The robot only has odometry."] * track.hides_pose)


def _by_distance(name: str, title: str, episodes: pd.DataFrame, is_warped: bool = False) -> Table:
    """Returns a table of one setting: a row for each distance, and one for all that the results have in common."""
    rows = {str(distance): group for distance, group in episodes.groupby("distance")}
    common = common_distances(episodes)
    if len(common) > 1:
        rows[_format_distances(common)] = episodes[episodes.distance.isin(common)]
    paper = _printed("local", episodes, is_warped)
    return make_table(name, title, "Distance from start to goal in cells.", "distance", rows, paper)


def _printed(task: str, episodes: pd.DataFrame, is_warped: bool = False) -> Printed:
    """Returns the paper's values for the setting of some episodes; none for other mazes than the eval mazes."""
    found = {} if episodes.mazes.iloc[0] else printed(task, int(episodes["size"].iloc[0]), is_warped)
    return {
        agent: {metric: {str(row): value for row, value in values.items()} for metric, values in metrics.items()}
        for agent, metrics in found.items()
    }


def _rows_by(episodes: pd.DataFrame, column: str) -> Rows:
    """Returns a row for each value of a column, with the distances that all results have in common."""
    return {f"{value:g}": group for value, group in at_common_distances(episodes).groupby(column)}


def _line(metric: str, row: str, column: str, mean: Estimate, num_episodes: int) -> dict[str, Any]:
    named = {"metric": metric, "row": row, "column": column, "source": "measured"}
    return named | {"episodes": num_episodes, "value": mean.value, "low95": mean.low, "high95": mean.high}


def _format_distances(distances: list[int]) -> str:
    """Returns distances as "1–15" if they follow one another, or else as "2, 4, 6"."""
    first, last = distances[0], distances[-1]
    is_range = len(distances) > 2 and len(distances) == last - first + 1
    return f"{first}–{last}" if is_range else ", ".join(map(str, distances))
