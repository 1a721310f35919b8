"""A result's episodes and paths as text in the page, which explorer.js unpacks."""

from __future__ import annotations

import base64
import json
import math
import zlib
from collections.abc import Mapping, Sequence

import numpy as np

from mazebench.evaluation.trajectories import Trajectories
from mazebench.maps.maze import Cell
from mazebench.report.mazes import shown_ends
from mazebench.report.results import ReportedResult

# explorer.js counts in the same units.
_POSITION_UNITS = 32  # a metre; one unit is about a pixel on the screen
_YAW_UNITS = 256  # a turn


def pack_trials(result: ReportedResult, results: Sequence[ReportedResult]) -> str:
    """Packs what is the same for all agents: the episodes, and the maps where they are perturbed."""
    setting, trajectories = result.setting, result.trajectories
    maps = trajectories.shown.tobytes() if trajectories is not None and setting.levels else b""
    return _pack(_trial_columns(result, results), maps)


def pack_drives(result: ReportedResult) -> str:
    """Packs the outcomes of the episodes, and the paths."""
    episodes, trajectories = result.episodes, result.trajectories
    columns = {
        "success": episodes.success.astype(int).tolist(),
        "steps": episodes.steps.tolist(),
        "driven": np.round(episodes.path_length, 2).tolist(),
    }
    return _pack(columns, b"" if trajectories is None else pack_poses(trajectories, result.setting.size))


def pack_poses(trajectories: Trajectories, size: int) -> bytes:
    """Packs poses in five planes with one byte of each pose: x low, x high, y low, y high, yaw.

    All values are differences from the pose before; those of x and y are zigzag-encoded.
    """
    units = np.round(trajectories.pose[:, :2].astype(np.float64) * _POSITION_UNITS)
    place = np.clip(units, -_POSITION_UNITS, (size + 1) * _POSITION_UNITS).astype(np.int32)
    change = np.diff(place, axis=0, prepend=0)
    zigzag = ((change << 1) ^ (change >> 31)).astype("<u2")
    turns = np.round(trajectories.pose[:, 2].astype(np.float64) * (_YAW_UNITS / (2 * math.pi))).astype(np.int64)
    yaw = np.diff(turns, prepend=0) % _YAW_UNITS
    planes = [(zigzag[:, axis] >> shift) & 255 for axis in (0, 1) for shift in (0, 8)]
    return np.stack([*planes, yaw]).astype(np.uint8).tobytes()


def to_base64(content: bytes) -> str:
    """Returns base64 as text."""
    return base64.b64encode(content).decode("ascii")


def _pack(columns: Mapping[str, Sequence[float]], content: bytes) -> str:
    """Returns columns and the bytes behind them, deflated, in base64."""
    text = json.dumps(columns, separators=(",", ":")).encode("ascii")
    return to_base64(zlib.compress(len(text).to_bytes(4, "little") + text + content, 9))


def _trial_columns(result: ReportedResult, results: Sequence[ReportedResult]) -> dict[str, list[float]]:
    episodes, trajectories, size = result.episodes, result.trajectories, result.setting.size
    columns: dict[str, list[float]] = {
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
    shown = shown_ends(result, results)
    if shown is not None:
        columns["shownStart"], columns["shownGoal"] = (_indices(cells, size) for cells in shown)
    return columns


def _indices(cells: Sequence[Cell], size: int) -> list[float]:
    return [row * size + column for row, column in cells]
