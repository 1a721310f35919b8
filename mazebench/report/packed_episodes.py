"""A result's episodes and paths as text in the page, which explorer.js unpacks."""

from __future__ import annotations

import base64
import json
import math
import zlib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from mazebench.maps.maze import Cell
from mazebench.report.mazes import shown_ends
from mazebench.report.results import ReportedResult
from mazebench.results.trajectories import Trajectories

POSITION_UNITS = 32  # a cell; one unit is about a pixel on the screen
YAW_UNITS = 256  # a turn
_LARGEST = 2**14 - 1  # units: a difference of two has 16 bits


def pack_trials(result: ReportedResult, results: Sequence[ReportedResult]) -> str:
    """Packs what is the same for all agents: the episodes, and the shown maps where they need not be the mazes."""
    trajectories, maps = result.trajectories, b""
    if trajectories is not None and not result.setting.is_exact:
        maps = (trajectories.shown if trajectories.picture is None else trajectories.picture).tobytes()
    return _pack(_trial_columns(result, results), maps)


def pack_drives(result: ReportedResult) -> str:
    """Packs the outcomes of the episodes, and the paths; behind the true ones those that the agent observed."""
    episodes, trajectories = result.episodes, result.trajectories
    paths = [] if trajectories is None else [trajectories.pose.astype(np.float64), lay_on_first_poses(trajectories)]
    columns = {
        "success": episodes.success.astype(int).tolist(),
        "steps": episodes.steps.tolist(),
        "driven": np.round(episodes.path_length, 2).tolist(),
        "spl": np.round(episodes.spl, 2).tolist(),
        "splGrid": np.round(episodes.spl_grid, 2).tolist(),
    }
    scale = [result.setting.cell_size] * 2 + [1.0]
    in_cells = [poses / scale for poses in paths if poses is not None]
    return _pack(columns, b"".join(map(pack_poses, in_cells)))


def lay_on_first_poses(trajectories: Trajectories) -> np.ndarray | None:
    """Returns `[sum(length), 3]` float64: the observed paths, each turned and moved so that it begins in the true pose.

    None where no observed poses were recorded.
    """
    if trajectories.observed is None:
        return None
    true, observed = trajectories.pose.astype(np.float64), trajectories.observed.astype(np.float64)
    first = np.repeat(np.cumsum(trajectories.length) - trajectories.length, trajectories.length)
    turn = true[first, 2] - observed[first, 2]
    x, y = (observed - observed[first])[:, :2].T
    moved = np.column_stack([np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y])
    return np.column_stack([true[first, :2] + moved, observed[:, 2] + turn])


def pack_poses(poses: np.ndarray) -> bytes:
    """Packs poses `[sum(length), 3]`, x and y in cells and yaw in rad, as 16-bit integers: all x, all y, all yaw.

    Each is the change from the pose before, in units.
    """
    units = np.round(poses * (POSITION_UNITS, POSITION_UNITS, YAW_UNITS / (2 * math.pi)))
    changes = np.diff(np.clip(units, -_LARGEST, _LARGEST), axis=0, prepend=0)
    changes[:, 2] = (changes[:, 2] + YAW_UNITS / 2) % YAW_UNITS - YAW_UNITS / 2  # the shorter way around
    return changes.T.astype("<i2").tobytes()


def to_base64(content: bytes) -> str:
    """Returns base64 as text."""
    return base64.b64encode(content).decode("ascii")


def _pack(columns: Mapping[str, Any], content: bytes) -> str:
    """Returns columns and the bytes behind them, deflated, in base64."""
    text = json.dumps(columns, separators=(",", ":")).encode("ascii")
    text += b" " * (len(text) % 2)  # arrays of 16-bit integers begin at even places
    return to_base64(zlib.compress(len(text).to_bytes(4, "little") + text + content, 9))


def _trial_columns(result: ReportedResult, results: Sequence[ReportedResult]) -> dict[str, Any]:
    episodes, trajectories, size = result.episodes, result.trajectories, result.setting.size
    columns: dict[str, Any] = {
        "maze": pd.factorize(episodes.maze)[0].tolist(),
        "start": _indices(episodes.start, size),
        "goal": _indices(episodes.goal, size),
        "distance": episodes.distance.tolist(),
        "shortest": np.round(episodes.shortest_path, 2).tolist(),
        "seed": episodes.seed.tolist(),
        "landmarks": [],
        "landmarkCounts": [],
        "groups": {fact: episodes[fact].astype(int).tolist() for fact in result.facts},
    }
    if trajectories is not None:
        ends = np.cumsum(trajectories.num_landmarks) - 1  # the last one of an episode is its goal
        columns["landmarks"] = np.delete(trajectories.landmark, ends).tolist()
        columns["landmarkCounts"] = (trajectories.num_landmarks - 1).tolist()
        if trajectories.marks is not None:
            columns["shownStart"], columns["shownGoal"] = trajectories.marks.T.tolist()
    shown = shown_ends(result, results)
    if shown is not None:
        columns["shownStart"], columns["shownGoal"] = (_indices(cells, size) for cells in shown)
    return columns


def _indices(cells: Iterable[Cell], size: int) -> list[float]:
    return [row * size + column for row, column in cells]
