"""The report as one page that needs no network: figures, tables, and an explorer of the episodes, all data inside.

explorer.js and canvas.js replay episodes.
"""

from __future__ import annotations

import base64
import functools
import hashlib
import itertools
import json
import math
import zlib
from collections.abc import Sequence
from importlib import resources
from typing import Any

import jinja2
import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from mazebench.constants import STEP_TIME
from mazebench.maps import colors
from mazebench.report.episodes import ReportedResult
from mazebench.report.figures import color_of, stack, to_svg
from mazebench.report.paper_figures import TIME_COLORS, Drawn
from mazebench.report.table import Table
from mazebench.report.tables import FINER
from mazebench.results import naming
from mazebench.results.metrics import METRICS, ON_TIMES
from mazebench.results.paper import reference
from mazebench.results.trajectories import Trajectory
from mazebench.tasks.episode import Episode, schedule_of
from mazebench.tasks.schedule import moved_along
from mazebench.tasks.task import Task
from mazebench.world.ray_casting import NUM_RAYS

_POSITION_UNITS = 32  # a cell; one unit is about a pixel on the screen
_YAW_UNITS = 256  # a turn
ON_TIME = ON_TIMES[0].name  # the column of episodes that says which are on time


def build_page(
    results: Sequence[ReportedResult],
    head: str,
    table: Table,
    figures: Sequence[Drawn],
    provenance: pd.DataFrame,
    warnings: Sequence[str],
) -> str:
    """Returns the page as HTML; text from results is escaped in it, or stands in it as JSON and base64.

    `head` describes the results in a line, and `table` has all their settings.
    """
    labels = list(dict.fromkeys(result.label for result in results))
    images = [(each, as_svg(each.figure), as_svg(stack(each.figure)) if each.stacks else "") for each in figures]
    is_printed = table.values.source.eq("paper").any()
    citation = "{authors}, {title}. {note}".format_map(reference()) if is_printed else ""
    told: dict[str, Any] = {"subtitle": head, "warnings": warnings, "citation": citation, "figures": images}
    return with_explorer("page.html", results, provenance, **told, table=_cells(table, labels), note=table.note)


def _cells(table: Table, labels: Sequence[str]) -> dict[str, Any]:
    """Returns the content of a table as page.html shows it: agents with their colours, rows, and values by metric."""
    values = {(line["row"], line["column"], line["metric"]): line for line in table.values.to_dict("records")}
    columns, rows, setting = list(table.values.column.cat.categories), [], ""
    for row in table.values.row.cat.categories:
        is_finer = bool(setting) and row.startswith(setting + FINER)
        setting = setting if is_finer else row
        cells = [[values.get((row, column, metric)) for metric in table.metrics] for column in columns]
        rows.append({"name": row.removeprefix(setting + FINER), "is_finer": is_finer, "cells": cells})
    colors_of = {label: color_of(label, labels) for label in labels}
    return {
        "opens": table.metrics.index(ON_TIME),  # the metric that is shown first
        "metrics": [METRICS[metric].title for metric in table.metrics],
        "columns": [(column, colors_of.get(column, "")) for column in columns],
        "rows": rows,
        "has_finer": any(row["is_finer"] for row in rows),
        "opens_finer": sum(not row["is_finer"] for row in rows) == 1,
    }


def with_explorer(
    template: str, results: Sequence[ReportedResult], provenance: pd.DataFrame, opens: str = "", **told: Any
) -> str:
    """Returns a page with the explorer of all results as HTML.

    Args:
      template: the file of the page, which extends frame.html.
      results: what the explorer has.
      provenance: where results come from.
      opens: the episode at which the explorer opens, as the address names one; by default the first one.
      **told: further values for the template.
    """
    marks = f":root {{ --start: {colors.to_hex(colors.START)}; --goal: {colors.to_hex(colors.GOAL)}; }}\n"
    style, script = marks + _read("page.css"), _read("canvas.js") + _read("explorer.js")
    columns: dict[str, int] = {}  # JSON, deflated, in base64, with their numbers
    pack = functools.cache(lambda text: _base64(zlib.compress(text.encode("ascii"), 9)))
    used = []
    for result in results:
        parts = (json.dumps(each, separators=(",", ":")) for each in (_trials(result), _outcomes(result)))
        used.append([columns.setdefault(pack(part), len(columns)) for part in parts])
    templates = jinja2.Environment(loader=jinja2.PackageLoader("mazebench", "report"), autoescape=True)
    return templates.get_template(template).render(
        **told,
        style=style,
        style_hash=_hash(style),
        provenance=provenance.to_html(index=False, border=0),
        data=_explorer_data(results, used) | {"opens": opens},
        columns=columns,
        script=script,
        script_hash=_hash(script),
    )


def as_svg(figure: Figure) -> str:
    """Returns a figure as SVG in base64, as the pages hold it."""
    return _base64(to_svg(figure))


def _read(name: str) -> str:
    return resources.files("mazebench.report").joinpath(name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    return f"sha256-{_base64(hashlib.sha256(text.encode('utf-8')).digest())}"


def _base64(content: bytes) -> str:
    return base64.b64encode(content).decode("ascii")


def _explorer_data(results: Sequence[ReportedResult], columns: Sequence[list[int]]) -> dict[str, Any]:
    """Returns what explorer.js knows of all results before it unpacks the episodes of one, `columns` of each."""
    settings = sorted({result.setting for result in results}, key=naming.order)
    mazes: dict[tuple[str, str | None], int] = {}  # names and walls, with their numbers
    described = []
    for result, used in zip(results, columns, strict=True):
        setting, task, maps = result.setting, result.task, result.shown
        walls = {name: _base64(np.packbits(walls).tobytes()) for name, walls in result.walls.items()}
        own = [(name, walls.get(name)) for name in result.episodes.maze.unique()]
        described.append(
            {
                "label": result.label,
                "setting": settings.index(setting),
                "columns": used,
                "mazes": [mazes.setdefault(each, len(mazes)) for each in own],
                "size": setting.size,
                "unit": "cells" if setting.track is None else "m",  # of distances
                "cellSize": setting.cell_size or 1.0,
                "episodes": len(result.episodes),
                "exact": setting.is_exact,
                "picture": 0 if not maps or maps[0].are_cells else len(maps[0].walls),  # pixels a side, if no cells
                "lidar": task.options.lidar.max_range if task and "lidar" in task.options.sensors else 0,  # m
                "groups": result.facts,
                "hidden": "map" in result.summary.task.hide,
            }
        )
    # The explorer opens where the best of the agents that know no truth is late most often, of results with paths.
    joined = pd.DataFrame([(each.label, *each.episodes[["success", ON_TIME]].mean()) for each in results])
    rates = joined.groupby(0, sort=False)[1].mean()
    on_time = dict(zip(results, joined[2], strict=True))
    first = min(
        results,
        key=lambda each: (not each.trajectories, each.summary.privileged, -rates[each.label], on_time[each]),
    )
    return {
        "settings": list(map(naming.described, settings)),
        "rays": NUM_RAYS,
        "units": {"position": _POSITION_UNITS, "yaw": _YAW_UNITS, "step": STEP_TIME},
        "timeColors": [mpl.colors.to_hex(color) for color in TIME_COLORS(range(32))],
        "mazes": [{"name": name, "walls": walls} for name, walls in mazes],
        "results": described,
        "first": results.index(first),
    }


def _trials(result: ReportedResult) -> dict[str, Any]:
    """Returns by columns what results of one task have in common, and the shown maps where they are not the mazes."""
    episodes, size = result.episodes, result.setting.size or 0
    columns: dict[str, Any] = {
        "maze": pd.factorize(episodes.maze)[0].tolist(),
        "start": [row * size + column for row, column in episodes.start],
        "goal": [row * size + column for row, column in episodes.goal],
        "distance": episodes.distance.tolist(),
        "shortest": episodes.shortest_path.round(2).tolist(),
        "seed": episodes.seed.tolist(),
        "oracle": [None if pd.isna(steps) else int(steps) for steps in episodes.oracle_steps],
        "groups": {fact: episodes[fact].astype(int).tolist() for fact in result.facts},
    }
    if maps := result.shown:
        columns["shownStart"] = [shown.start for shown in maps]
        columns["shownGoal"] = [shown.goal for shown in maps]
        columns["landmarks"] = [shown.landmarks for shown in maps]
        if not (result.setting.is_exact and maps[0].are_cells):
            pixels = (np.packbits(shown.walls) if shown.are_cells else shown.walls for shown in maps)
            columns["maps"] = _base64(b"".join(map(np.ndarray.tobytes, pixels)))
    return columns


def _outcomes(result: ReportedResult) -> dict[str, Any]:
    """Returns by columns what came of the episodes, and the paths."""
    episodes, trajectories = result.episodes, result.trajectories
    columns: dict[str, Any] = {
        "success": episodes.success.astype(int).tolist(),
        "onTime": episodes[ON_TIME].astype(int).tolist(),
        "steps": episodes.steps.tolist(),
        "driven": episodes.path_length.round(2).tolist(),
        "spl": episodes.spl.round(2).tolist(),
        "splGrid": episodes.spl_grid.round(2).tolist(),
    }
    if trajectories:
        scale = [result.setting.cell_size or 1.0] * 2 + [1.0]
        columns["path"] = _changes(np.concatenate([each.pose for each in trajectories]) / scale)
        if result.task is not None and result.task.moves_doors:
            columns["doors"] = _doors(result, result.task, trajectories)
        if trajectories[0].observed is not None:
            columns["observed"] = _changes(np.concatenate([lay_on_first_pose(each) for each in trajectories]) / scale)
    return columns


def _doors(result: ReportedResult, task: Task, trajectories: Sequence[Trajectory]) -> list[list[list[int]]]:
    """Returns for each leg when doors move: the step of the leg, and the cells that are wall then and were not before.

    Or the other way round. What stands when a leg begins is of its step 0.
    """
    indices = {maze.name: index for index, maze in enumerate(task.arena.fixed_mazes)}
    legs = zip(*(result.episodes[name] for name in ("maze", "start", "goal", "seed")), trajectories, strict=True)
    found, step, moved, schedule = [], 0, 0, None
    for number, (maze, start, goal, seed, trajectory) in enumerate(legs):
        if number % task.options.num_goals == 0:
            schedule, step, moved = schedule_of(task, Episode(indices[maze], start, goal, 0.0, seed)), 0, 0
        assert schedule is not None
        sets = moved_along(schedule, trajectory.pose[:, :2].tolist(), step, moved)
        grid, changes = np.arange(task.size**2).reshape(task.size, -1), []
        for at, (before, after) in enumerate(itertools.pairwise([0, *sets])):
            cells = [
                grid[door.cells()].ravel() for each, door in enumerate(schedule.doors) if (before ^ after) >> each & 1
            ]
            changes += [[at, *np.concatenate(cells).tolist()]] if cells else []
        found.append(changes)
        step, moved = step + len(sets) - 1, sets[-1]
    return found


def lay_on_first_pose(trajectory: Trajectory) -> np.ndarray:
    """Returns `[L, 3]` float64: the observed path, turned and moved to begin in the true pose."""
    assert trajectory.observed is not None
    first, observed = trajectory.pose[0].astype(np.float64), trajectory.observed.astype(np.float64)
    turn = first[2] - observed[0, 2]
    x, y = (observed - observed[0])[:, :2].T
    moved = np.column_stack([np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y])
    return np.column_stack([first[:2] + moved, observed[:, 2] + turn])


def _changes(poses: np.ndarray) -> list[list[int]]:
    """Returns all x, all y and all yaw of poses in cells and rad, each as its change from the pose before, in units."""
    units = np.round(poses * (_POSITION_UNITS, _POSITION_UNITS, _YAW_UNITS / (2 * math.pi)))
    changes = np.diff(units, axis=0, prepend=0).astype(int)
    changes[:, 2] = (changes[:, 2] + _YAW_UNITS // 2) % _YAW_UNITS - _YAW_UNITS // 2  # the shorter way around
    return changes.T.tolist()
