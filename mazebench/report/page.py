"""The report as one page that needs no network: figures and an explorer of the episodes, all data inside.

charts.js draws the figures of `figures/figure.py`; explorer.js and drawing.js replay episodes.
"""

from __future__ import annotations

import base64
import dataclasses
import hashlib
import json
from collections.abc import Mapping, Sequence
from importlib import resources
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.markers import MarkerStyle
from matplotlib.path import Path
from matplotlib.transforms import Affine2D

from mazebench.constants import STEP_TIME
from mazebench.maps import colors
from mazebench.report.document import PROVENANCE_HEAD, benchmark_versions, provenance_rows
from mazebench.report.figures.figure import Figure
from mazebench.report.figures.trajectories import CELL_COLORS, TIME_COLORS
from mazebench.report.looks import INKS, Look
from mazebench.report.mazes import real_walls
from mazebench.report.packed_episodes import POSITION_UNITS, YAW_UNITS, pack_drives, pack_trials, to_base64
from mazebench.report.results import ReportedResult
from mazebench.report.settings import Setting
from mazebench.report.table import METRICS, Table
from mazebench.results.paper import citation, reference
from mazebench.tasks.context import default_context_size
from mazebench.tasks.options import TaskOptions
from mazebench.world.lidar import NUM_RAYS
from mazebench.world.mjcf import BODY_RADIUS

_SVG_LETTERS = {Path.MOVETO: "M", Path.LINETO: "L", Path.CURVE3: "Q", Path.CURVE4: "C", Path.CLOSEPOLY: "Z"}
_NUM_TIME_COLORS = 32


def build_page(
    results: Sequence[ReportedResult],
    labels: Sequence[str],
    tables: Sequence[Table],
    curves: Mapping[str, Figure],
    violins: Sequence[Figure],
    looks: Mapping[str, Look],
    warnings: Sequence[str],
) -> str:
    """Returns the page as HTML; text from results is in it as JSON and base64 only.

    Args:
      results: all results.
      labels: of the agents, in the order in which they are listed.
      tables: all tables.
      curves: the figures of tables, by the tables' names.
      violins: further figures.
      looks: of all series in the figures.
      warnings: lines about the results.
    """
    settings = sorted({result.setting for result in results})
    mazes, places = _mazes(results)
    trials = [pack_trials(result, results) for result in results]
    packed_trials = list(dict.fromkeys(trials))
    listed = [
        {
            **_describe(result),
            "setting": settings.index(result.setting),
            "mazes": here,
            "trials": packed_trials.index(of_result),
        }
        for result, here, of_result in zip(results, places, trials, strict=True)
    ]
    printed = {column.label: None for table in tables for column in table.columns if column.is_paper}
    content = {
        "benchmark": benchmark_versions(results),
        "citation": citation(),
        "paperNote": reference()["note"],
        "labels": labels,
        "printed": list(printed),
        "looks": {label: _look(look) for label, look in looks.items()},
        "metrics": {name: text for name, text in METRICS.items() if any(name in table.metrics for table in tables)},
        "warnings": warnings,
        "charts": [_chart(table, curves) for table in sorted(tables, key=lambda table: not table.x)],
        "violins": [_figure(figure) for figure in violins],
        "settings": [_names(setting) for setting in settings],
        "rays": NUM_RAYS,
        "units": {"position": POSITION_UNITS, "yaw": YAW_UNITS, "step": STEP_TIME, "body": BODY_RADIUS},
        "timeColors": [mpl.colors.to_hex(TIME_COLORS(n / (_NUM_TIME_COLORS - 1))) for n in range(_NUM_TIME_COLORS)],
        "mazes": mazes,
        "results": listed,
        "provenance": [PROVENANCE_HEAD, *provenance_rows(results)],
        "first": _first(results),
    }
    marks = {"start": colors.to_hex(colors.START), "goal": colors.to_hex(colors.GOAL), **CELL_COLORS}
    style = f":root {{ {' '.join(f'--{name}: {color};' for name, color in marks.items())} }}\n{_read('page.css')}"
    script = "".join(map(_read, ("charts.js", "drawing.js", "explorer.js")))
    policy = f"default-src 'none'; style-src '{_hash(style)}'; script-src '{_hash(script)}'"
    packed = [f'<script type="text/plain" id="trials-{n}">{text}</script>' for n, text in enumerate(packed_trials)]
    packed += [
        f'<script type="text/plain" id="drives-{number}">{pack_drives(result)}</script>'
        for number, result in enumerate(results)
    ]
    parts = {
        "POLICY": policy,
        "STYLE": style,
        "DATA": _json(content),
        "EPISODES": "\n".join(packed),
        "SCRIPT": script,
    }
    page = _read("page.html")
    pieces = page.split("@")  # names of parts stand between the odd and even @
    return "".join(parts[piece] if index % 2 else piece for index, piece in enumerate(pieces))


def _read(name: str) -> str:
    return resources.files("mazebench.report").joinpath(name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode('utf-8')).digest()).decode('ascii')}"


def _json(content: Any) -> str:
    """Returns JSON for a script element: no text in it can end the element or open a comment."""
    return json.dumps(_plain(content), separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _plain(value: Any) -> Any:
    """Returns what JSON has of a value: dataclasses as objects, numbers with three digits behind the point."""
    if dataclasses.is_dataclass(value):
        return {field.name: _plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {name: _plain(each) for name, each in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(each) for each in value]
    return round(float(value), 3) if isinstance(value, float) else value


def _chart(table: Table, curves: Mapping[str, Figure]) -> dict[str, Any]:
    """Returns a table, its texts line by line for each metric, and the panels of its figure."""
    chart: dict[str, Any] = {"title": table.title, "note": table.note, "panels": ()}
    if table.name in curves:
        chart = _figure(curves[table.name])
    return chart | {"lines": {metric: table.lines(metric) for metric in table.metrics}}


def _figure(figure: Figure) -> dict[str, Any]:
    """Returns a figure without its looks, which all figures share."""
    return {"title": figure.title, "note": figure.note, "panels": figure.panels}


def _look(look: Look) -> dict[str, Any]:
    """Returns a look with its marker as an SVG path of size 1, and the ink as the page's text has it."""
    style = MarkerStyle(look.marker)
    path = style.get_path().transformed(style.get_transform() + Affine2D().scale(1, -1))
    marker = ""
    for corners, code in path.iter_segments(simplify=False):
        marker += _SVG_LETTERS[code] + ("" if code == Path.CLOSEPOLY else " ".join(f"{at:.3g}" for at in corners))
    color = "var(--ink)" if look.color in INKS else look.color
    changed = {"color": color, "marker": marker, "isFilled": bool(style.is_filled())}
    return {name: value for name, value in dataclasses.asdict(look).items() if name != "name"} | changed


def _mazes(results: Sequence[ReportedResult]) -> tuple[list[dict[str, Any]], list[list[int]]]:
    """Returns all mazes once, with walls where they are known, and the indices of each result's mazes."""
    index: dict[tuple[Any, ...], int] = {}
    mazes: list[dict[str, Any]] = []
    places: list[list[int]] = []
    for result in results:
        setting = result.setting
        here = []
        for name in result.episodes.maze.unique():
            key = (setting.split, setting.mazes, setting.size, name)
            if key not in index:
                index[key] = len(mazes)
                walls = real_walls(result, name, results)
                mazes.append(
                    {"name": name, "walls": None if walls is None else to_base64(np.packbits(walls).tobytes())}
                )
            here.append(index[key])
        places.append(here)
    return mazes, places


def _names(setting: Setting) -> dict[str, Any]:
    """Returns what the explorer calls a setting: the levels of a track share a name."""
    of_split = "" if setting.split == "eval" else f", {setting.split} mazes"
    return {"name": f"track {setting.track}{of_split}" if setting.track else str(setting), "level": setting.level}


def _describe(result: ReportedResult) -> dict[str, Any]:
    setting, trajectories = result.setting, result.trajectories
    picture = None if trajectories is None else trajectories.picture
    provenance = result.summary.provenance
    sensors = (provenance.options.model_extra or {}).get("sensors", ())
    lidar = TaskOptions(track=setting.track or None, lidar_noise=result.summary.lidar_noise).lidar
    # Cells a side of the agent's map: those of the shown map, unless it is large and the agent asks for fewer.
    side = setting.size if picture is None else picture.shape[-1]
    context_size = (provenance.model_extra or {}).get("context_size")  # results of earlier versions do not say it
    if setting.track or side == default_context_size(side):
        context_size = side
    return {
        "label": result.label,
        "size": setting.size,
        "cellSize": setting.cell_size,
        "episodes": len(result.episodes),
        "poses": 0 if trajectories is None else len(trajectories.pose),
        "exact": setting.is_exact,
        "context": min(context_size, side) if isinstance(context_size, int) else 0,  # 0 if it is not known
        "picture": 0 if picture is None else picture.shape[-1],
        "odometry": trajectories is not None and trajectories.observed is not None,
        "lidar": lidar.max_range if setting.track or "lidar" in sensors else 0,  # m
        "groups": result.facts,
    }


def _first(results: Sequence[ReportedResult]) -> int:
    """Returns the result that the explorer opens with: one with paths, hierarchical if there is such a one."""
    order = sorted(
        range(len(results)),
        key=lambda number: (
            results[number].trajectories is None,
            not results[number].setting.is_exact,
            results[number].setting.task != "hierarchical",
            results[number].setting.size,
            -results[number].setting.landmark_distance,
        ),
    )
    return order[0]
