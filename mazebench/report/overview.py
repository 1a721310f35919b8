"""The table of all results: a row for each setting."""

from __future__ import annotations

from collections.abc import Sequence

from mazebench.report.measures import make_table
from mazebench.report.results import ReportedResult
from mazebench.report.rows import DISTANCES_NOTE, Row, common_distances, format_distances, setting_row
from mazebench.report.settings import Setting
from mazebench.report.table import Table


def overview(results: Sequence[ReportedResult], labels: Sequence[str]) -> Table:
    """Returns the table of all settings."""
    rows: dict[str, Row] = {}
    settings = sorted({result.setting for result in results})
    for setting in settings:
        group = [result for result in results if result.setting == setting]
        has_namesake = sum(str(other) == str(setting) for other in settings) > 1
        rows[_name(setting, group, has_namesake)] = setting_row(setting, group)
    return make_table("all", "All results", DISTANCES_NOTE, "setting", rows, (), results, labels)


def _name(setting: Setting, results: Sequence[ReportedResult], has_namesake: bool) -> str:
    """Returns the setting in words, with what tells it from others and which episodes count."""
    parts = [str(setting)]
    if has_namesake and setting.mazes:
        parts.append(setting.mazes[0] + (f" and {len(setting.mazes) - 1} more" if len(setting.mazes) > 1 else ""))
    common = common_distances(results)
    if common and any(set(result.episodes.distance.tolist()) != set(common) for result in results):
        parts.append(f"distances {format_distances(common)}")
    elif setting.task == "local" and not common:
        parts.append("no distances in common")
    return ", ".join(parts)
