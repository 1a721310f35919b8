"""Results read back from disk, with suspicion: they may be cut short, edited, or no results at all."""

from __future__ import annotations

import dataclasses
import math
import pathlib
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from mazebench.errors import InputError
from mazebench.records import CONFIG, EPISODES, SUMMARY, Record, parse_json, read_json, read_lines

if TYPE_CHECKING:
    from mazebench.evaluation.protocol import Trial

SUITE = "suite.json"

_METRICS = ("success_rate", "spl", "spl_grid")
_TOLERANCE = 1e-9  # of a mean that is computed again


@dataclasses.dataclass(frozen=True)
class Result:
    """A finished evaluation."""

    folder: pathlib.Path
    summary: dict[str, Any]
    records: list[Record]  # in protocol order


def load_result(folder: pathlib.Path) -> Result:
    """The finished evaluation in `folder`; nothing there is changed.

    Raises:
      InputError: if there is none, or it is damaged, or its records are not those that its summary was made from.
    """
    if not (folder / SUMMARY).is_file():
        raise InputError(f"{folder}: expected a finished evaluation, found {_what_is_in(folder)}")
    summary = read_json(folder / SUMMARY)
    fault = _summary_fault(summary)
    if fault:
        raise InputError(f"{folder / SUMMARY}: expected an evaluation's summary, found {fault}")
    records = _read_records(folder / EPISODES)
    if len(records) != summary["episodes"]:
        raise InputError(f"{folder / EPISODES}: expected {summary['episodes']} records, found {len(records)}")
    for key in _METRICS:
        name = "success" if key == "success_rate" else key
        found = math.fsum(record[name] for record in records) / len(records)
        if not math.isclose(summary["overall"][key], found, abs_tol=_TOLERANCE):
            raise InputError(
                f"{folder / EPISODES}: expected the records that {SUMMARY} was made from, {key} "
                f"{summary['overall'][key]:.6f}, found others, {found:.6f}"
            )
    return Result(folder, summary, records)


def read_suite(out: pathlib.Path) -> dict[str, Any]:
    """What a suite's folder says is in it: "suite", "benchmark", "parts", "agents", and the agents' "folders".

    Raises:
      InputError: if it says nothing that makes sense.
    """
    content = read_json(out / SUITE)
    parts, folders = (content.get(key) if isinstance(content, dict) else None for key in ("parts", "folders"))
    if (
        not isinstance(parts, list)
        or not isinstance(folders, dict)
        or not all(isinstance(name, str) and is_safe_name(name) for name in [*parts, *folders.values()])
    ):
        raise InputError(f"{out / SUITE}: expected a suite's parts and folders, found {str(content)[:60]!r}")
    return content


def find_parts(folder: pathlib.Path) -> dict[str, pathlib.Path]:
    """The finished evaluations that a folder stands for, by their parts' names; one named "" if it is itself one.

    Raises:
      InputError: if it is a suite's with several agents, or nothing in it is finished.
    """
    if (folder / SUITE).is_file():
        suite = read_suite(folder)
        agents = list(suite["folders"].values())
        if len(agents) != 1:
            named = ", ".join(str(folder / agent) for agent in agents)
            raise InputError(
                f"{folder}: expected one agent's results, found {len(agents)} agents'; name one of: {named}"
            )
        names, folder = suite["parts"], folder / agents[0]
    elif (folder / SUMMARY).exists():
        return {"": folder}
    else:
        # In the suite's order where the folder is an agent's in one.
        suite = read_suite(folder.parent) if (folder.parent / SUITE).is_file() else {"parts": []}
        found = sorted(path.parent.name for path in folder.glob(f"*/{SUMMARY}"))
        names = list(dict.fromkeys([*(name for name in suite["parts"] if name in found), *found]))
    parts = {name: folder / name for name in names if (folder / name / SUMMARY).exists()}
    if not parts:
        raise InputError(f"{folder}: expected a finished evaluation, found {_what_is_in(folder)}")
    return parts


def check_records(folder: pathlib.Path, records: Sequence[Record], trials: Sequence[Trial]) -> None:
    """Does nothing if `records`, which `folder` holds, are of `trials`.

    Raises:
      InputError: if one is damaged or of another episode.
    """
    for record in records:
        fault = _record_fault(record)
        if not fault and record["episode"] >= len(trials):
            fault = f"episode {record['episode']} of {len(trials)}"
        if not fault:
            trial = trials[record["episode"]]
            expected = [*trial.episode.start, *trial.episode.goal, trial.episode.seed]
            found = [*record["start"], *record["goal"], record["seed"]]
            fault = None if found == expected else f"start, goal and seed {found} where {expected} were to be run"
        if fault:
            raise InputError(f"{folder}: expected records of this run, found {fault}")


def is_safe_name(name: str) -> bool:
    """Whether a name leads nowhere but into the folder itself."""
    return bool(name) and not name.startswith(".") and "/" not in name and "\\" not in name and "\0" not in name


def _read_records(path: pathlib.Path) -> list[Record]:
    records: list[Record] = []
    for number, line in enumerate(read_lines(path)):
        try:
            record = parse_json(line)
        except ValueError:
            record = None
        fault = _record_fault(record)
        if fault or record["episode"] != number:
            raise InputError(
                f"{path}: expected the record of episode {number} in line {number + 1}, "
                f"found {fault or 'episode ' + str(record['episode'])}"
            )
        records.append({name: record[name] for name in _FIELDS})
    return records


def _is_int(value: Any) -> bool:
    return type(value) is int and 0 <= value < 2**53


def _is_text(value: Any) -> bool:
    return isinstance(value, str) and value.isprintable()


def _is_cell(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(_is_int, value))


def _is_length(value: Any) -> bool:
    return type(value) in (int, float) and 0 <= value < 2**53


def _is_share(value: Any) -> bool:
    return type(value) in (int, float) and 0 <= value <= 1


def _is_made_by(options: Any) -> bool:
    return isinstance(options, dict) and _is_int(options.get("landmark_distance"))


def _is_short_number(text: str) -> bool:
    return text.isascii() and text.isdecimal() and len(text) < 10


_FIELDS: dict[str, Callable[[Any], bool]] = {
    "episode": _is_int,
    "maze": _is_text,
    "start": _is_cell,
    "goal": _is_cell,
    "distance": _is_int,
    "success": lambda value: isinstance(value, bool),
    "steps": _is_int,
    "path_length": _is_length,
    "shortest_path": _is_length,
    "spl": _is_share,
    "spl_grid": _is_share,
    "seed": _is_int,
}
_SUMMARY_FIELDS: dict[str, Callable[[Any], bool]] = {
    "agent": _is_text,
    "task": _is_text,
    "size": _is_int,
    "split": _is_text,
    "benchmark": _is_text,
    "episodes": _is_int,
    "perturbation": lambda value: isinstance(value, dict) and all(map(_is_length, value.values())),
    "provenance": lambda value: isinstance(value, dict) and _is_made_by(value.get("options")),
    "overall": lambda value: isinstance(value, dict),
    "by_distance": lambda value: isinstance(value, dict) and all(map(_is_short_number, value)),
}


def _record_fault(record: Any) -> str | None:
    if not isinstance(record, dict):
        return "no record"
    for name, is_legal in _FIELDS.items():
        if name not in record:
            return f"a record without {name}"
        if not is_legal(record[name]):
            return f"a record with {name} {str(record[name])[:60]!r}"
    return None


def _summary_fault(summary: Any) -> str | None:
    if not isinstance(summary, dict):
        return "no object"
    for name, is_legal in _SUMMARY_FIELDS.items():
        if not is_legal(summary.get(name)):
            return f"{name} {str(summary.get(name))[:60]!r}"
    if summary["episodes"] < 1:
        return f"{summary['episodes']} episodes"
    rows = {"overall": summary["overall"], **summary["by_distance"]}
    faults = (f"{name} {fault}" for name, row in rows.items() if (fault := _row_fault(row)))
    return next(faults, None)


def _row_fault(row: Any) -> str | None:
    """What is wrong with the figures of some episodes."""
    if not isinstance(row, dict):
        return f"{str(row)[:60]!r}"
    for key in _METRICS:
        interval = row.get(f"{key}_ci95")
        if not _is_share(row.get(key)):
            return f"{key} {str(row.get(key))[:60]}"
        if not isinstance(interval, list) or len(interval) != 2 or not all(map(_is_share, interval)):
            return f"{key}_ci95 {str(interval)[:60]}"
    return None if _is_int(row.get("n")) else f"n {str(row.get('n'))[:60]}"


def _what_is_in(folder: pathlib.Path) -> str:
    if not folder.exists():
        return "nothing there"
    if not folder.is_dir():
        return "a file"
    names = sorted(path.name for path in folder.iterdir())
    if CONFIG in names:
        return "one that is not finished; go on with `mazebench eval` and --resume"
    return f"{names[0]!r} in it" if names else "an empty folder"
