"""The report as one page that needs no network: figures, tables, and an explorer of the episodes, all data inside.

explorer.js and drawing.js replay episodes.
"""

from __future__ import annotations

import base64
import hashlib
import html
import json
from collections.abc import Iterator, Mapping, Sequence
from importlib import resources
from typing import Any

import matplotlib as mpl
import numpy as np

from mazebench.constants import STEP_TIME
from mazebench.maps import colors
from mazebench.report.document import PROVENANCE_HEAD, Picture, benchmark_versions, counted, provenance_rows
from mazebench.report.figures.trajectories import CELL_COLORS, TIME_COLORS
from mazebench.report.mazes import real_walls
from mazebench.report.packed_episodes import POSITION_UNITS, YAW_UNITS, pack_drives, pack_trials, to_base64
from mazebench.report.results import ReportedResult
from mazebench.report.settings import Setting
from mazebench.report.table import Table
from mazebench.results.paper import citation, reference
from mazebench.tasks.context import default_context_size
from mazebench.tasks.options import TaskOptions
from mazebench.world.lidar import NUM_RAYS
from mazebench.world.mjcf import BODY_RADIUS

_NUM_TIME_COLORS = 32


def build_page(
    results: Sequence[ReportedResult],
    labels: Sequence[str],
    tables: Sequence[Table],
    figures: Mapping[Picture, str],
    warnings: Sequence[str],
) -> str:
    """Returns the page as HTML; text from results is escaped in it, or stands in it as JSON and base64.

    Args:
      results: all results.
      labels: of the agents, in the order in which they are listed.
      tables: all tables.
      figures: the SVG of each figure.
      warnings: lines about the results.
    """
    count = sum(len(result.episodes) for result in results)
    style = f":root {{ {' '.join(f'--{name}: {color};' for name, color in _colors().items())} }}\n{_read('page.css')}"
    script = "".join(map(_read, ("drawing.js", "explorer.js")))
    trials = [pack_trials(result, results) for result in results]
    packed_trials = list(dict.fromkeys(trials))
    packed = [_block(f"trials-{number}", text) for number, text in enumerate(packed_trials)]
    packed += [_block(f"drives-{number}", pack_drives(result)) for number, result in enumerate(results)]
    parts = {
        # Figures have attributes `style`.
        "POLICY": f"default-src 'none'; style-src '{_hash(style)}'; style-src-attr 'unsafe-inline'; "
        f"script-src '{_hash(script)}'",
        "STYLE": style,
        "SUBTITLE": html.escape(
            f"Benchmark {benchmark_versions(results)}; {', '.join(labels)}; {counted(count, 'episode')} in "
            f"{counted(len(results), 'result')}."
        ),
        "NOTES": _notes(warnings),
        "CITATION": html.escape(f"{citation()}. {reference()['note']}"),
        "FIGURES": "\n".join(_sections(tables, figures)),
        "PROVENANCE": _to_html([PROVENANCE_HEAD, *provenance_rows(results)]),
        "DATA": _json(_explorer_data(results, [packed_trials.index(each) for each in trials])),
        "EPISODES": "\n".join(packed),
        "SCRIPT": script,
    }
    pieces = _read("page.html").split("@")  # names of parts stand between the odd and even @
    return "".join(parts[piece] if index % 2 else piece for index, piece in enumerate(pieces))


def _colors() -> dict[str, str]:
    return {"start": colors.to_hex(colors.START), "goal": colors.to_hex(colors.GOAL), **CELL_COLORS}


def _block(name: str, text: str) -> str:
    return f'<script type="text/plain" id="{name}">{text}</script>'


def _notes(warnings: Sequence[str]) -> str:
    if not warnings:
        return ""
    lines = "".join(f"<li>{html.escape(line)}</li>" for line in warnings)
    return (
        f'<details class="notice"><summary>Notes on the results ({len(warnings)})</summary><ul>{lines}</ul></details>'
    )


def _sections(tables: Sequence[Table], figures: Mapping[Picture, str]) -> Iterator[str]:
    """Yields each figure with the table of its name, then the tables that have no figure."""
    by_name = {table.name: table for table in tables}
    for picture, svg in figures.items():
        yield _section(picture.title, picture.note, svg, by_name.pop(picture.name, None), is_open=False)
    for table in by_name.values():
        yield _section(table.title, table.note, "", table, is_open=True)


def _section(title: str, note: str, svg: str, table: Table | None, is_open: bool) -> str:
    hidden = ' class="hidden"' if svg else ""  # the figure has its title
    parts = [f"<h3{hidden}>{html.escape(title)}</h3>", svg]
    if note:
        parts.append(f'<p class="note">{html.escape(note)}</p>')
    if table is not None:
        forms = "".join(f'<div class="scroll">{_to_html(table.lines(metric))}</div>' for metric in table.metrics)
        parts.append(f"<details{' open' * is_open}><summary>The values as a table</summary>{forms}</details>")
    return f'<section class="figure">{"".join(parts)}</section>'


def _to_html(lines: Sequence[Sequence[str]]) -> str:
    """Returns the table of lines of texts, the head first."""
    head, *body = ([html.escape(text) for text in line] for line in lines)
    rows = "".join(f"<tr><td>{'</td><td>'.join(line)}</td></tr>" for line in body)
    return f"<table><thead><tr><th>{'</th><th>'.join(head)}</th></tr></thead><tbody>{rows}</tbody></table>"


def _explorer_data(results: Sequence[ReportedResult], trials: Sequence[int]) -> dict[str, Any]:
    settings = sorted({result.setting for result in results})
    mazes, places = _mazes(results)
    listed = [
        {
            **_describe(result),
            "setting": settings.index(result.setting),
            "mazes": here,
            "trials": of_result,
        }
        for result, here, of_result in zip(results, places, trials, strict=True)
    ]
    return {
        "settings": [_names(setting) for setting in settings],
        "rays": NUM_RAYS,
        "units": {"position": POSITION_UNITS, "yaw": YAW_UNITS, "step": STEP_TIME, "body": BODY_RADIUS},
        "timeColors": [mpl.colors.to_hex(TIME_COLORS(n / (_NUM_TIME_COLORS - 1))) for n in range(_NUM_TIME_COLORS)],
        "mazes": mazes,
        "results": listed,
        "first": _first(results),
    }


def _read(name: str) -> str:
    return resources.files("mazebench.report").joinpath(name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode('utf-8')).digest()).decode('ascii')}"


def _json(content: Any) -> str:
    """Returns JSON for a script element: no text in it can end the element or open a comment."""
    return json.dumps(content, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


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
