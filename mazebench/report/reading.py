"""Reads an evaluation folder as strictly as a stranger's: what it holds was perhaps cut short, edited or made up."""

from __future__ import annotations

import math
import pathlib
from typing import Any

import numpy as np

from mazebench.errors import InputError, unknown
from mazebench.evaluation.metrics import spl
from mazebench.evaluation.trajectories import TRAJECTORIES, Trajectories, load_trajectories
from mazebench.maps.benchmark import SIZES
from mazebench.maps.files import MAX_FILES
from mazebench.maps.maze import MAX_SIZE, MIN_SIZE
from mazebench.maps.perturb import MAX_WARP
from mazebench.records import EPISODES, SUMMARY, parse_json, read_json, read_lines
from mazebench.report.results import METRICS, PERTURBATIONS, Episodes, Result, Setting, Warn
from mazebench.tasks.spec import TASKS

_TOLERANCE = 1e-6  # of figures that should be equal
_SPLITS = ("train", "eval", "custom")
_FIELDS: dict[str, type] = {
    "episode": int,
    "agent": str,
    "task": str,
    "size": int,
    "maze": str,
    "distance": int,
    "success": bool,
    "steps": int,
    "path_length": float,
    "shortest_path": float,
    "spl": float,
    "spl_grid": float,
    "seed": int,
}
_KEPT = (*_FIELDS, "split", "start", "goal", *PERTURBATIONS)  # of a record


def read_result(folder: pathlib.Path, warn: Warn) -> Result:
    """The result in an evaluation folder; `warn` is told what was mended or left out.

    Raises:
      InputError: if it holds none, or one that contradicts itself.
    """
    if not (folder / SUMMARY).exists():
        raise InputError(f"{folder}: expected a finished evaluation, found no {SUMMARY}; eval --resume goes on with it")
    summary = _read_object(folder / SUMMARY)
    records = _read_records(folder / EPISODES)
    setting = _read_setting(folder / SUMMARY, summary, records)
    _check_records(folder / EPISODES, records, summary)
    episodes = _to_columns(records)
    _check_spl(folder / EPISODES, episodes)
    fault = _disagreement(summary, episodes)
    if fault:
        warn(f"{folder / SUMMARY}: {fault}; recomputed from the records")
    provenance = _optional(summary, "provenance", dict, {})
    agent = str(summary["agent"])
    return Result(
        path=folder,
        agent=agent,
        label=agent,
        setting=setting,
        seed=_optional(_optional(provenance, "options", dict, {}), "seed", int, 0),
        checkpoint=_optional(provenance, "checkpoint_sha256", str, None),
        benchmark=(str(summary["benchmark"]), _optional(provenance, "benchmark_manifest_sha256", str, "")),
        episodes=episodes,
        trajectories=_read_trajectories(folder, episodes, setting, warn),
        provenance=provenance,
    )


def _read_object(path: pathlib.Path) -> dict[str, Any]:
    content = read_json(path)
    if not isinstance(content, dict):
        raise InputError(f"{path}: expected an evaluation's summary, found another kind of JSON")
    for key, kind in (("agent", str), ("task", str), ("size", int), ("benchmark", str), ("episodes", int)):
        if not _is_a(content.get(key), kind):
            raise InputError(f"{path}: expected an evaluation's summary, found none with {key} as {kind.__name__}")
    return content


def _read_records(path: pathlib.Path) -> list[dict[str, Any]]:
    records: list[dict[str, Any]] = []
    for number, line in enumerate(read_lines(path), 1):
        if not line.endswith(b"\n"):
            raise InputError(f"{path}: is cut short in line {number}")
        try:
            record = parse_json(line)
        except ValueError as error:
            raise InputError(f"{path}: expected a record in line {number}, found {str(error)[:120]}") from error
        fault = _record_fault(record)
        if fault:
            raise InputError(f"{path}: line {number}: {fault}")
        records.append({key: record.get(key) for key in _KEPT})
    if not records:
        raise InputError(f"{path}: expected records, found none")
    return records


def _is_a(value: Any, kind: type) -> bool:
    if kind is float:
        return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 2**53
    if kind is str:
        return isinstance(value, str) and value.isprintable()  # half a character could not be written again
    if kind is int:
        return isinstance(value, int) and not isinstance(value, bool) and abs(value) < 2**53
    return isinstance(value, kind)


def _record_fault(record: Any) -> str | None:
    """What is wrong with a record taken by itself, in words."""
    if not isinstance(record, dict):
        return "expected a record, found another kind of JSON"
    for key, kind in _FIELDS.items():
        value = record.get(key)
        if not _is_a(value, kind):
            return f"expected {key} as {kind.__name__}, found {str(value)[:40]!r}"
        if isinstance(value, (int, float)) and not 0 <= value < 2**53:
            return f"expected {key} of at least 0, found {str(value)[:40]}"
    for key in ("start", "goal"):
        cell = record.get(key)
        if not isinstance(cell, list) or len(cell) != 2 or not all(_is_a(index, int) for index in cell):
            return f"expected {key} as a cell, found {str(cell)[:40]!r}"
        if not all(0 <= index < record["size"] for index in cell):
            return f"expected {key} in a maze of {record['size']} cells a side, found {cell}"
    if record["distance"] >= record["size"] ** 2:
        return f"expected a distance in a maze of {record['size']} cells a side, found {record['distance']}"
    return None


def _read_setting(path: pathlib.Path, summary: dict[str, Any], records: list[dict[str, Any]]) -> Setting:
    if summary["task"] not in TASKS:
        raise InputError(f"{path}: {unknown('task', summary['task'], TASKS)}")
    if not MIN_SIZE <= summary["size"] <= MAX_SIZE:
        raise InputError(f"{path}: expected a size of {MIN_SIZE} to {MAX_SIZE} cells, found {summary['size']}")
    split = summary.get("split")
    if split not in _SPLITS:
        raise InputError(f"{path}: {unknown('split', split, _SPLITS)}")
    if split != "custom" and summary["size"] not in SIZES:
        raise InputError(f"{path}: {unknown('size', summary['size'], SIZES)}")
    perturbation = summary.get("perturbation")
    if not isinstance(perturbation, dict) or not all(_is_a(perturbation.get(name), float) for name in PERTURBATIONS):
        raise InputError(f"{path}: expected perturbation with {', '.join(PERTURBATIONS)} as numbers, found another")
    for name, most in zip(PERTURBATIONS, (1, MAX_WARP, math.inf), strict=True):
        if not 0 <= perturbation[name] <= most:
            raise InputError(f"{path}: expected {name} from 0 to {most:g}, found {perturbation[name]:g}")
    return Setting(
        task=summary["task"],
        size=summary["size"],
        split=split,
        landmark_distance=_landmark_distance(path, summary) if summary["task"] == "hierarchical" else 0,
        mazes=tuple(sorted({record["maze"] for record in records})) if split == "custom" else (),
        **{name: float(perturbation[name]) for name in PERTURBATIONS},
    )


def _landmark_distance(path: pathlib.Path, summary: dict[str, Any]) -> int:
    options = _optional(_optional(summary, "provenance", dict, {}), "options", dict, {})
    found = summary.get("landmark_distance", options.get("landmark_distance"))
    if found is None or not _is_a(found, int) or not 1 <= found <= MAX_SIZE**2:
        raise InputError(f"{path}: expected a landmark distance of at least 1 cell, found {str(found)[:40]}")
    return found


def _check_records(path: pathlib.Path, records: list[dict[str, Any]], summary: dict[str, Any]) -> None:
    """Refuses records that are not all of the summary's evaluation, in order."""
    if len(records) != summary["episodes"]:
        raise InputError(f"{path}: expected the summary's {summary['episodes']} records, found {len(records)}")
    num_mazes = len({record["maze"] for record in records})
    if num_mazes > MAX_FILES:
        raise InputError(f"{path}: expected records of at most {MAX_FILES} mazes, found {num_mazes}")
    expected = {key: summary[key] for key in ("agent", "task", "size", "split")} | summary["perturbation"]
    for number, record in enumerate(records):
        for key, value in {"episode": number, **expected}.items():
            if record.get(key) != value:
                found = str(record.get(key))[:40]
                raise InputError(f"{path}: line {number + 1}: expected {key} {str(value)[:40]!r}, found {found!r}")


def _to_columns(records: list[dict[str, Any]]) -> Episodes:
    mazes = tuple(dict.fromkeys(record["maze"] for record in records))
    index = {name: number for number, name in enumerate(mazes)}
    columns = {
        key: np.array([record[key] for record in records])
        for key in ("start", "goal", "distance", "success", "steps", "seed")
    }
    columns |= {
        key: np.array([record[key] for record in records], dtype=np.float64)
        for key in ("path_length", "shortest_path", "spl", "spl_grid")
    }
    return Episodes(maze=np.array([index[record["maze"]] for record in records]), mazes=mazes, **columns)


def _check_spl(path: pathlib.Path, episodes: Episodes) -> None:
    """Refuses records whose scores do not follow from their outcomes and lengths: they were edited."""
    for name, shortest in (("spl", episodes.shortest_path), ("spl_grid", episodes.distance.astype(np.float64))):
        found, expected = episodes.values(name), spl(episodes.success, shortest, episodes.path_length)
        wrong = np.flatnonzero(np.abs(found - expected) > _TOLERANCE)
        if len(wrong):
            line = int(wrong[0])
            raise InputError(
                f"{path}: line {line + 1}: expected {name} {expected[line]:.6f} by its success and lengths, "
                f"found {found[line]:.6f}"
            )


def _disagreement(summary: dict[str, Any], episodes: Episodes) -> str | None:
    """The first figure of a summary that its records do not give, in words."""
    everything = np.ones(len(episodes), dtype=bool)
    parts = {"overall": (summary.get("overall"), everything)}
    by_distance = _optional(summary, "by_distance", dict, {})
    for distance in np.unique(episodes.distance).tolist():
        parts[f"distance {distance}"] = (by_distance.get(str(distance)), episodes.distance == distance)
    for name, (figures, chosen) in parts.items():
        if not isinstance(figures, dict):
            return f"has no figures of {name}"
        expected = {"n": float(chosen.sum())} | {key: float(episodes.values(key)[chosen].mean()) for key in METRICS}
        for key, value in expected.items():
            if not _is_a(figures.get(key), float) or abs(figures[key] - value) > _TOLERANCE:
                return f"{key} of {name} is {str(figures.get(key))[:20]}, by the records {value:.6g}"
    return None


def _optional(content: dict[str, Any], key: str, kind: type, default: Any) -> Any:
    """`content[key]` if it is of the right kind: what a report can do without is not worth a refusal."""
    return content[key] if _is_a(content.get(key), kind) else default


def _read_trajectories(folder: pathlib.Path, episodes: Episodes, setting: Setting, warn: Warn) -> Trajectories | None:
    """The trajectories if the folder has some that fit the records."""
    path = folder / TRAJECTORIES
    if not path.exists():
        return None
    try:
        trajectories = load_trajectories(path, len(episodes))
    except InputError as error:
        warn(f"{error}; reported without paths")
        return None
    if trajectories.size != setting.size or not np.array_equal(trajectories.length, episodes.steps + 1):
        warn(f"{path}: expected the start and each step of the records, found others; reported without paths")
        return None
    return trajectories
