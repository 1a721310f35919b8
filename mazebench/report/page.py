"""The report as one page that needs no network: figures and an explorer of the episodes, all data inside."""

from __future__ import annotations

import base64
import hashlib
import json
import math
import zlib
from collections.abc import Sequence
from importlib import resources
from typing import Any

import numpy as np

from mazebench.evaluation.paper import citation, reference
from mazebench.evaluation.trajectories import Trajectories
from mazebench.maps import perturb
from mazebench.report.distributions import Distribution, Violin
from mazebench.report.episodes import real_walls
from mazebench.report.provenance import HEAD, provenance_rows
from mazebench.report.results import METRICS, Result
from mazebench.report.table import Cell, Table
from mazebench.tasks.episode import Episode

# explorer.js counts in the same units.
_POSITION_UNITS = 32  # a metre: a pixel on the screen
_YAW_UNITS = 256  # a turn


def build_page(
    results: Sequence[Result],
    labels: Sequence[str],
    tables: Sequence[Table],
    distributions: Sequence[Distribution],
    warnings: Sequence[str],
) -> str:
    """The page as HTML. Nothing from the results stands in it but as JSON and base64, which the script reads."""
    settings = sorted({result.setting for result in results})
    mazes, places = _mazes(results)
    trials = [_pack_trials(result) for result in results]
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
        "benchmark": results[0].benchmark[0],
        "citation": citation(),
        "paperNote": reference()["note"],
        "labels": list(labels),
        "metrics": METRICS,
        "warnings": list(warnings),
        "tables": [_table(table) for table in tables],
        "violins": [_distribution(distribution) for distribution in distributions],
        "settings": [str(setting) for setting in settings],
        "mazes": mazes,
        "results": listed,
        "provenance": [HEAD, *provenance_rows(results)],
        "first": _first(results),
    }
    style, script = _read("page.css"), _read("charts.js") + _read("explorer.js")
    policy = f"default-src 'none'; style-src '{_hash(style)}'; script-src '{_hash(script)}'"
    packed = [f'<script type="text/plain" id="trials-{n}">{text}</script>' for n, text in enumerate(packed_trials)]
    packed += [
        f'<script type="text/plain" id="drives-{number}">{_pack_drives(result)}</script>'
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


def pack_poses(trajectories: Trajectories, size: int) -> bytes:
    """Five planes of bytes, one byte a pose in each: low and high of x, of y, and yaw; differences, x and y zigzag."""
    units = np.round(trajectories.pose[:, :2].astype(np.float64) * _POSITION_UNITS)
    place = np.clip(units, -_POSITION_UNITS, (size + 1) * _POSITION_UNITS).astype(np.int32)
    change = np.diff(place, axis=0, prepend=0)
    zigzag = ((change << 1) ^ (change >> 31)).astype("<u2")
    turns = np.round(trajectories.pose[:, 2].astype(np.float64) * (_YAW_UNITS / (2 * math.pi))).astype(np.int64)
    yaw = np.diff(turns, prepend=0) % _YAW_UNITS
    planes = [(zigzag[:, axis] >> shift) & 255 for axis in (0, 1) for shift in (0, 8)]
    return np.stack([*planes, yaw]).astype(np.uint8).tobytes()


def _read(name: str) -> str:
    return resources.files("mazebench.report").joinpath(name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode('utf-8')).digest()).decode('ascii')}"


def _json(content: Any) -> str:
    """JSON that can stand in a script element: no text in it can end the element or open a comment."""
    return json.dumps(content, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def _cell(cell: Cell | None) -> list[float | int | None] | None:
    if cell is None:
        return None
    low, high = (None if value is None else round(value, 4) for value in (cell.low, cell.high))
    return [round(cell.value, 4), low, high, cell.episodes, *([] if cell.runs is None else [cell.runs])]


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


def _mazes(results: Sequence[Result]) -> tuple[list[dict[str, Any]], list[list[int]]]:
    """All mazes once, with walls where they are known, and for each result the places of its mazes among them."""
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
                mazes.append({"name": name, "walls": None if walls is None else _base64(np.packbits(walls).tobytes())})
            here.append(index[key])
        places.append(here)
    return mazes, places


def _describe(result: Result) -> dict[str, Any]:
    return {
        "label": result.label,
        "size": result.setting.size,
        "episodes": len(result.episodes),
        "poses": 0 if result.trajectories is None else len(result.trajectories.pose),
        "perturbedMap": bool(result.setting.map_flip or result.setting.map_warp),
    }


def _first(results: Sequence[Result]) -> int:
    """What the explorer opens with: a result with paths, on hierarchical routes rather than local ones."""
    order = sorted(
        range(len(results)),
        key=lambda number: (
            results[number].trajectories is None,
            bool(results[number].setting.perturbed),
            results[number].setting.task != "hierarchical",
            results[number].setting.size,
            -results[number].setting.landmark_distance,
        ),
    )
    return order[0]


def _pack_trials(result: Result) -> str:
    """What the episodes were, and the maps where they are not the mazes: the same for all agents."""
    setting, trajectories = result.setting, result.trajectories
    is_other_map = setting.map_flip or setting.map_warp
    maps = trajectories.shown.tobytes() if trajectories is not None and is_other_map else b""
    return _pack(_trial_columns(result), maps)


def _pack_drives(result: Result) -> str:
    """What came of the episodes, and the paths."""
    episodes, trajectories = result.episodes, result.trajectories
    columns = {
        "success": episodes.success.astype(int).tolist(),
        "steps": episodes.steps.tolist(),
        "driven": np.round(episodes.path_length, 2).tolist(),
    }
    return _pack(columns, b"" if trajectories is None else pack_poses(trajectories, result.setting.size))


def _pack(columns: dict[str, list[Any]], content: bytes) -> str:
    """Columns and bytes behind them, deflated: as explorer.js unpacks them."""
    text = json.dumps(columns, separators=(",", ":")).encode("ascii")
    return _base64(zlib.compress(len(text).to_bytes(4, "little") + text + content, 9))


def _trial_columns(result: Result) -> dict[str, list[Any]]:
    episodes, trajectories, size = result.episodes, result.trajectories, result.setting.size
    columns = {
        "maze": episodes.maze.tolist(),
        "start": (episodes.start @ [size, 1]).tolist(),
        "goal": (episodes.goal @ [size, 1]).tolist(),
        "distance": episodes.distance.tolist(),
        "shortest": np.round(episodes.shortest_path, 2).tolist(),
        "seed": episodes.seed.tolist(),
        "landmarks": [],
        "landmarkCounts": [],
    }
    if trajectories is not None:
        ends = np.cumsum(trajectories.num_landmarks) - 1  # the last one of an episode is its goal
        columns["landmarks"] = np.delete(trajectories.landmark, ends).tolist()
        columns["landmarkCounts"] = (trajectories.num_landmarks - 1).tolist()
    if result.setting.map_warp:
        columns["shownStart"], columns["shownGoal"] = _warped_ends(result)
    return columns


def _warped_ends(result: Result) -> tuple[list[int], list[int]]:
    """Where start and goal lie on each warped map, as cell numbers."""
    episodes, setting = result.episodes, result.setting
    ends: tuple[list[int], list[int]] = ([], [])
    for start, goal, seed in zip(episodes.start.tolist(), episodes.goal.tolist(), episodes.seed.tolist(), strict=True):
        warps = Episode(0, tuple(start), tuple(goal), 0.0, seed).streams()[1]
        homography = perturb.random_homography(setting.size, setting.map_warp, warps)
        for cells, cell in zip(ends, (start, goal), strict=True):
            row, column = perturb.warp_cell(tuple(cell), homography, setting.size)
            cells.append(row * setting.size + column)
    return ends


def _base64(content: bytes) -> str:
    return base64.b64encode(content).decode("ascii")
