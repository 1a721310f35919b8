"""Rows of tables: the episodes of a result that each one is about.

`E` is the number of episodes of a result.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from mazebench.report.results import ReportedResult
from mazebench.report.settings import Setting

# Chooses the episodes (`[E]` bool) of a result that a row is about; none of a result that is not in the row.
Row = Callable[[ReportedResult], np.ndarray]
# On rows of one setting each.
DISTANCES_NOTE = (
    "Means over all episodes. If results cover different distances, only the distances that all of them cover count."
)


def distance_rows(results: Sequence[ReportedResult]) -> dict[str, Row]:
    """Returns a row for each distance from start to goal, and one for all distances that the results have in common."""
    distances = sorted({distance for result in results for distance in result.episodes.distance.tolist()})
    rows: dict[str, Row] = {str(distance): _at_distances([distance]) for distance in distances}
    common = common_distances(results)
    if len(common) > 1:
        rows[format_distances(common)] = _at_distances(common)
    return rows


def setting_rows(
    results: Sequence[ReportedResult], names: Mapping[float, str], level: Callable[[Setting], float]
) -> dict[str, Row]:
    """Returns a row for each level of the settings, with the distances that all results have in common.

    Args:
      results: of settings that differ in `level` only.
      names: of the rows, by level.
      level: of a setting.
    """
    distances = common_distances(results)

    def row(wanted: float) -> Row:
        return lambda result: chosen_episodes(result, distances) & (level(result.setting) == wanted)

    return {name: row(wanted) for wanted, name in names.items()}


def setting_row(setting: Setting, results: Sequence[ReportedResult]) -> Row:
    """Returns the row of one setting, with the distances that all results of this setting have in common."""
    distances = common_distances([result for result in results if result.setting == setting])
    return lambda result: chosen_episodes(result, distances) & (result.setting == setting)


def level_rows(results: Sequence[ReportedResult]) -> dict[str, Row]:
    """Returns a row for each level of the track that all results are of."""
    settings = sorted({result.setting for result in results})
    return {str(setting.level): setting_row(setting, results) for setting in settings}


def common_distances(results: Sequence[ReportedResult]) -> list[int]:
    """Returns the distances from start to goal that every result has, in cells; none for the hierarchical task."""
    if not results or results[0].setting.task == "hierarchical":
        return []
    return sorted(set.intersection(*(set(result.episodes.distance.tolist()) for result in results)))


def chosen_episodes(result: ReportedResult, distances: Sequence[int]) -> np.ndarray:
    """Returns `[E]` bool: the episodes at `distances`; all of them if there are no distances."""
    episodes = result.episodes
    return np.isin(episodes.distance, distances) if len(distances) else np.ones(len(episodes), dtype=bool)


def format_distances(distances: Sequence[int]) -> str:
    """Returns distances as "1–5, 8, 10"."""
    runs: list[list[int]] = []
    for distance in distances:
        if runs and runs[-1][-1] == distance - 1:
            runs[-1] = [runs[-1][0], distance]
        else:
            runs.append([distance])
    return ", ".join("–".join(map(str, run)) for run in runs)


def note_on_distances(results: Sequence[ReportedResult]) -> str:
    """Returns in a sentence which distances count where results of several settings are compared."""
    if results[0].setting.task == "hierarchical":
        return ""
    distances = common_distances(results)
    if not distances:
        return "The results have no distance in common: each value is over all distances of its result."
    return f"Distances {format_distances(distances)}."


def _at_distances(distances: Sequence[int]) -> Row:
    return lambda result: np.isin(result.episodes.distance, distances)
