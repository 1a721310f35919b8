"""The report as one page that needs no network: figures and an explorer of the episodes, all data inside."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Sequence
from importlib import resources
from typing import Any

import numpy as np

from mazebench.maps import colors
from mazebench.report.distributions import Distribution, Violin
from mazebench.report.looks import PALETTE
from mazebench.report.mazes import real_walls
from mazebench.report.packed_episodes import pack_drives, pack_trials, to_base64
from mazebench.report.provenance import HEAD, benchmark_versions, provenance_rows
from mazebench.report.results import ReportedResult
from mazebench.report.settings import Setting
from mazebench.report.table import METRIC_NAMES, Cell, Table
from mazebench.results.paper import citation, reference
from mazebench.world.lidar import MAX_RANGE, NUM_RAYS


def build_page(
    results: Sequence[ReportedResult],
    labels: Sequence[str],
    tables: Sequence[Table],
    distributions: Sequence[Distribution],
    warnings: Sequence[str],
) -> str:
    """Returns the page as HTML; text from results is in it as JSON and base64 only."""
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
    content = {
        "benchmark": benchmark_versions(results),
        "citation": citation(),
        "paperNote": reference()["note"],
        "labels": list(labels),
        "palette": [*PALETTE[:-1], "var(--ink)"],  # the grey is ink, light on a dark page
        "metrics": {
            name: text for name, text in METRIC_NAMES.items() if any(name in table.metrics for table in tables)
        },
        "warnings": list(warnings),
        "tables": [_table(table) for table in tables],
        "violins": [_distribution(distribution) for distribution in distributions],
        "settings": [_names(setting) for setting in settings],
        "lidar": {"rays": NUM_RAYS, "range": MAX_RANGE},
        "mazes": mazes,
        "results": listed,
        "provenance": [HEAD, *provenance_rows(results)],
        "first": _first(results),
    }
    marks = f"--start: {colors.to_hex(colors.START)}; --goal: {colors.to_hex(colors.GOAL)};"
    style = f":root {{ {marks} }}\n{_read('page.css')}"
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
    return json.dumps(content, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _cell(cell: Cell | None) -> list[float | int | None] | None:
    if cell is None:
        return None
    low, high = (None if value is None else round(value, 4) for value in (cell.low, cell.high))
    return [round(cell.value, 4), low, high, cell.episodes, cell.runs, int(cell.is_untrained_scale)]


def _table(table: Table) -> dict[str, Any]:
    columns = [
        {
            "label": column.label,
            "paper": column.is_paper,
            "cells": {metric: [_cell(cell) for cell in cells] for metric, cells in column.cells.items()},
        }
        for column in table.columns
    ]
    return {
        "title": table.title,
        "note": table.note,
        "rowName": table.row_name,
        "rows": table.rows,
        "x": table.x,
        "isTurned": table.is_turned,
        "columns": columns,
    }


def _distribution(distribution: Distribution) -> dict[str, Any]:
    return {
        "title": distribution.title,
        "note": distribution.note,
        "levelName": distribution.level_name,
        "levels": distribution.levels,
        "panels": [
            {"label": label, "violins": [_violin(violin) for violin in violins]}
            for label, violins in distribution.panels
        ],
    }


def _violin(violin: Violin | None) -> dict[str, Any] | None:
    if violin is None:
        return None
    return {"density": np.round(100 * violin.density).astype(int).tolist(), "mean": _cell(violin.mean)}


def _mazes(results: Sequence[ReportedResult]) -> tuple[list[dict[str, Any]], list[list[int]]]:
    """Returns all mazes once, with walls where they are known, and the indices of each result's mazes."""
    index: dict[tuple[Any, ...], int] = {}
    mazes: list[dict[str, Any]] = []
    places: list[list[int]] = []
    for result in results:
        setting = result.setting
        here = []
        for name in result.episodes.mazes:
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
    context_size = (provenance.model_extra or {}).get("context_size")  # results of earlier versions do not say it
    return {
        "label": result.label,
        "size": setting.size,
        "cellSize": setting.cell_size,
        "episodes": len(result.episodes),
        "poses": 0 if trajectories is None else len(trajectories.pose),
        "exact": setting.is_exact,
        "context": context_size if isinstance(context_size, int) else 0,
        "picture": 0 if picture is None else picture.shape[-1],
        "odometry": trajectories is not None and trajectories.observed is not None,
        "lidar": bool(setting.track) or "lidar" in sensors,
        "groups": list(result.episodes.facts),
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
