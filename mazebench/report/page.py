"""The report as one page that needs no network: figures, tables, and an explorer of the episodes, all data inside.

explorer.js and canvas.js replay episodes.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
import math
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib import resources
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd

from mazebench.constants import STEP_TIME
from mazebench.maps import colors
from mazebench.maps.maze import Cell
from mazebench.report.episodes import ReportedResult
from mazebench.report.figures import Drawn, to_svg
from mazebench.report.table import METRICS, Table
from mazebench.report.trajectory_figures import CELL_COLORS, TIME_COLORS
from mazebench.results.paper import citation, reference
from mazebench.results.played import Shown
from mazebench.results.trajectories import Trajectory
from mazebench.tasks.task_options import TaskOptions
from mazebench.world.mjcf import BODY_RADIUS
from mazebench.world.ray_casting import NUM_RAYS

_NUM_TIME_COLORS = 32
_POSITION_UNITS = 32  # a cell; one unit is about a pixel on the screen
_YAW_UNITS = 256  # a turn


def build_page(
    results: Sequence[ReportedResult],
    head: str,
    tables: Sequence[Table],
    figures: Sequence[Drawn],
    provenance: pd.DataFrame,
    warnings: Sequence[str],
) -> str:
    """Returns the page as HTML; text from results is escaped in it, or stands in it as JSON and base64.

    Args:
      results: all results.
      head: what the results are, in a line.
      tables: all tables.
      figures: of these tables and others.
      provenance: where the results come from.
      warnings: lines about the results.
    """
    style = f":root {{ {' '.join(f'--{name}: {color};' for name, color in _colors().items())} }}\n{_read('page.css')}"
    script = "".join(map(_read, ("canvas.js", "explorer.js")))
    columns: dict[str, int] = {}  # packed, with their numbers
    used = [
        [columns.setdefault(_pack(part), len(columns)) for part in (_trials(result), _outcomes(result))]
        for result in results
    ]
    parts = {
        # Figures have attributes `style`.
        "POLICY": f"default-src 'none'; style-src '{_hash(style)}'; style-src-attr 'unsafe-inline'; "
        f"script-src '{_hash(script)}'",
        "STYLE": style,
        "SUBTITLE": html.escape(head),
        "NOTES": _notes(warnings),
        "CITATION": html.escape(f"{citation()}. {reference()['note']}"),
        "FIGURES": "\n".join(_sections(tables, figures)),
        "PROVENANCE": provenance.to_html(index=False, border=0),
        "DATA": _json(_explorer_data(results, used)),
        "EPISODES": "\n".join(
            f'<script type="text/plain" id="columns-{number}">{text}</script>' for text, number in columns.items()
        ),
        "SCRIPT": script,
    }
    pieces = _read("page.html").split("@")  # names of parts stand between the odd and even @
    return "".join(parts[piece] if index % 2 else piece for index, piece in enumerate(pieces))


def _colors() -> dict[str, str]:
    return {"start": colors.to_hex(colors.START), "goal": colors.to_hex(colors.GOAL), **CELL_COLORS}


def _read(name: str) -> str:
    return resources.files("mazebench.report").joinpath(name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    return f"sha256-{_base64(hashlib.sha256(text.encode('utf-8')).digest())}"


def _json(content: Any) -> str:
    """Returns JSON for a script element: no text in it can end the element or open a comment."""
    return json.dumps(content, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _base64(content: bytes) -> str:
    return base64.b64encode(content).decode("ascii")


def _notes(warnings: Sequence[str]) -> str:
    if not warnings:
        return ""
    lines = "".join(f"<li>{html.escape(line)}</li>" for line in warnings)
    return (
        f'<details class="notice"><summary>Notes on the results ({len(warnings)})</summary><ul>{lines}</ul></details>'
    )


def _sections(tables: Sequence[Table], figures: Sequence[Drawn]) -> Iterator[str]:
    """Yields each figure with the table of its name, then the tables that have no figure."""
    by_name = {table.name: table for table in tables}
    for drawn in figures:
        yield _section(drawn.title, drawn.note, by_name.pop(drawn.name, None), to_svg(drawn))
    for table in by_name.values():
        yield _section(table.title, table.note, table)


def _section(title: str, note: str, table: Table | None, svg: str = "") -> str:
    parts = [f"<h3{' class=hidden' * bool(svg)}>{html.escape(title)}</h3>", svg]  # a figure has its title
    if note:
        parts.append(f'<p class="note">{html.escape(note)}</p>')
    if table is not None:
        forms = [table.wide(metric).rename_axis(None).to_html(border=0) for metric in table.metrics]
        named = "".join(
            f'<h4>{html.escape(METRICS[metric])}, by {html.escape(table.row_name)}</h4><div class="scroll">{form}</div>'
            for metric, form in zip(table.metrics, forms, strict=True)
        )
        parts.append(f"<details{' open' * (not svg)}><summary>The values as a table</summary>{named}</details>")
    return f'<section class="figure">{"".join(parts)}</section>'


def _explorer_data(results: Sequence[ReportedResult], columns: Sequence[list[int]]) -> dict[str, Any]:
    """Returns what explorer.js knows of all results before it unpacks the episodes of one, `columns` of each."""
    settings = sorted({result.setting for result in results})
    mazes, places = _mazes(results)
    return {
        "settings": [_names(setting) for setting in settings],
        "rays": NUM_RAYS,
        "units": {"position": _POSITION_UNITS, "yaw": _YAW_UNITS, "step": STEP_TIME, "body": BODY_RADIUS},
        "timeColors": [mpl.colors.to_hex(TIME_COLORS(n / (_NUM_TIME_COLORS - 1))) for n in range(_NUM_TIME_COLORS)],
        "mazes": mazes,
        "results": [
            {**_describe(result), "setting": settings.index(result.setting), "mazes": here, "columns": used}
            for result, here, used in zip(results, places, columns, strict=True)
        ],
        "first": _first(results),
    }


def _trials(result: ReportedResult) -> dict[str, Any]:
    """Returns by columns what results of one task have in common, and the shown maps where they are not the mazes."""
    episodes, size = result.episodes, result.setting.size or 0
    columns: dict[str, Any] = {
        "maze": pd.factorize(episodes.maze)[0].tolist(),
        "start": _indices(episodes.start, size),
        "goal": _indices(episodes.goal, size),
        "distance": episodes.distance.tolist(),
        "shortest": episodes.shortest_path.round(2).tolist(),
        "seed": episodes.seed.tolist(),
        "groups": {fact: episodes[fact].astype(int).tolist() for fact in result.facts},
    }
    if maps := _shown(result):
        columns["shownStart"] = [shown.start for shown in maps]
        columns["shownGoal"] = [shown.goal for shown in maps]
    if result.trajectories:
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
        "steps": episodes.steps.tolist(),
        "driven": episodes.path_length.round(2).tolist(),
        "spl": episodes.spl.round(2).tolist(),
        "splGrid": episodes.spl_grid.round(2).tolist(),
    }
    if trajectories:
        scale = [result.setting.cell_size] * 2 + [1.0]
        columns["path"] = _changes(np.concatenate([each.pose for each in trajectories]) / scale)
        if trajectories[0].observed is not None:
            columns["observed"] = _changes(np.concatenate([lay_on_first_pose(each) for each in trajectories]) / scale)
    return columns


def _shown(result: ReportedResult) -> list[Shown]:
    """Returns what was shown in the episodes of a result with paths or perturbations; nothing for others."""
    return result.shown if result.trajectories or result.setting.active_perturbations else []


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


def _pack(columns: Mapping[str, Any]) -> str:
    """Returns columns as JSON, deflated, in base64."""
    return _base64(zlib.compress(json.dumps(columns, separators=(",", ":")).encode("ascii"), 9))


def _indices(cells: Iterable[Cell], size: int) -> list[int]:
    return [int(row * size + column) for row, column in cells]


def _mazes(results: Sequence[ReportedResult]) -> tuple[list[dict[str, Any]], list[list[int]]]:
    """Returns all mazes once, with walls where they are known, and the indices of each result's mazes."""
    index: dict[tuple[Any, ...], int] = {}
    mazes: list[dict[str, Any]] = []
    places: list[list[int]] = []
    for result in results:
        setting = result.setting
        here = []
        for name in result.episodes.maze.unique():
            key = (setting.split_in_results, setting.mazes, setting.kinds, setting.num_mazes, setting.size, name)
            if key not in index:
                index[key] = len(mazes)
                walls = result.walls(name)
                mazes.append({"name": name, "walls": None if walls is None else _base64(np.packbits(walls).tobytes())})
            here.append(index[key])
        places.append(here)
    return mazes, places


def _names(setting: TaskOptions) -> dict[str, Any]:
    """Returns what the explorer calls a setting: the levels of a track share a name."""
    split, level = setting.split_in_results, setting.track_level
    of_split = "" if split == "eval" else f", {split} mazes"
    return {"name": f"track {setting.track}{of_split}" if setting.track else str(setting), "level": level}


def _describe(result: ReportedResult) -> dict[str, Any]:
    setting, task, maps = result.setting, result.task, _shown(result)
    return {
        "label": result.label,
        "size": setting.size,
        "cellSize": setting.cell_size,
        "episodes": len(result.episodes),
        "exact": setting.is_exact,
        "picture": 0
        if not maps or maps[0].are_cells
        else len(maps[0].walls),  # pixels on a side, where they are no cells
        "lidar": task.options.lidar.max_range if task and "lidar" in task.sensors else 0,  # m
        "groups": result.facts,
    }


def _first(results: Sequence[ReportedResult]) -> int:
    """Returns the result that the explorer opens with: one with paths, hierarchical if there is such a one."""
    order = sorted(
        range(len(results)),
        key=lambda number: (
            results[number].trajectories is None,
            not results[number].setting.is_exact,
            not results[number].setting.is_hierarchical,
            results[number].setting.size,
            -results[number].setting.landmark_distance,
        ),
    )
    return order[0]
