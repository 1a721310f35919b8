"""The episodes of all results in one table, and the rows of tables: groups of these episodes.

`Rows` are named groups of episodes of all agents. In one grouping, as by distance, each episode is in one row.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pandas as pd

from mazebench.report.results import ReportedResult
from mazebench.report.settings import Setting

Rows = dict[str, pd.DataFrame]

# On rows of one setting each.
DISTANCES_NOTE = (
    "Means over all episodes. If results cover different distances, only the distances that all of them cover count."
)
_OF_SETTING = ("task", "size", "split", "landmark_distance", "track", "level", "is_exact")


def join_episodes(results: Sequence[ReportedResult], labels: Sequence[str]) -> pd.DataFrame:
    """Returns the episodes of all results below one another, in the order of `results`.

    Beside the columns of `ReportedResult.episodes`, it has the `result`; the agent's `label` (ordered as in `labels`),
    `agent` (its name), `run` and `run_seed`; the `setting` (ordered), what the setting says, and each maze's number.
    """
    of_results = pd.DataFrame(
        {
            "result": result,
            "label": result.label,
            "agent": result.name,
            "run": result.run,
            "run_seed": result.seed,
            "setting": result.setting,
            **{name: getattr(result.setting, name) for name in _OF_SETTING},
        }
        for result in results
    )
    of_results["label"] = pd.Categorical(of_results.label, labels, ordered=True)
    of_results["setting"] = pd.Categorical(of_results.setting, sorted(of_results.setting.unique()), ordered=True)

    number = np.repeat(np.arange(len(results)), [len(result.episodes) for result in results])
    episodes = pd.concat([result.episodes for result in results], ignore_index=True)
    episodes = pd.concat([episodes, of_results.take(number).reset_index(drop=True)], axis=1)
    episodes["maze_index"] = pd.factorize(episodes.maze)[0]
    for fact in facts_of(episodes):
        episodes[fact] = episodes[fact].eq(True)  # no value where a result doesn't tell it
    return episodes


def settings_of(episodes: pd.DataFrame) -> list[Setting]:
    """Returns the settings of which there are episodes, sorted."""
    return sorted(episodes.setting.unique())


def facts_of(episodes: pd.DataFrame) -> list[str]:
    """Returns the columns that are facts of a track."""
    return list(dict.fromkeys(fact for result in episodes.result.unique() for fact in result.facts))


def rows_by_distance(episodes: pd.DataFrame) -> Rows:
    """Returns a row for each distance from start to goal, and one for all distances that the results have in common."""
    rows = {str(distance): group for distance, group in episodes.groupby("distance")}
    common = common_distances(episodes)
    if len(common) > 1:
        rows[format_distances(common)] = episodes[episodes.distance.isin(common)]
    return rows


def rows_by(episodes: pd.DataFrame, column: str, name: Callable[[Any], str] = str) -> Rows:
    """Returns a row for each value of a column, with the distances that all results have in common."""
    return {name(value): group for value, group in at_common_distances(episodes).groupby(column)}


def rows_by_level(episodes: pd.DataFrame) -> Rows:
    """Returns a row for each level of a track, with the distances that all results of this level have in common."""
    return {str(level): at_common_distances(group) for level, group in episodes.groupby("level")}


def common_distances(episodes: pd.DataFrame) -> list[int]:
    """Returns the distances from start to goal that every result has, in cells; none for the hierarchical task."""
    if episodes.task.eq("hierarchical").any():
        return []
    num_results = episodes.groupby("distance").result.nunique()
    return num_results.index[num_results == episodes.result.nunique()].tolist()


def at_common_distances(episodes: pd.DataFrame) -> pd.DataFrame:
    """Returns the episodes at the distances that every result has; all episodes if there are no such distances."""
    common = common_distances(episodes)
    return episodes[episodes.distance.isin(common)] if common else episodes


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
