"""Results read back from disk, with suspicion: they may be cut short, edited, or no results at all."""

from __future__ import annotations

import dataclasses
import json
import math
import pathlib
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from mazebench.errors import InputError, read_at_most
from mazebench.records import CONFIG, EPISODES, SUMMARY, Record, read_json

if TYPE_CHECKING:
    from mazebench.evaluation.protocol import Trial

SUITE = "suite.json"

_MAX_BYTES = 2**30  # of records; the 1,500 local episodes of a benchmark's size take 0.6 MB
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
    for key in ("success_rate", "spl", "spl_grid"):
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
    content = read_at_most(path, _MAX_BYTES, "records")
    if len(content) > _MAX_BYTES:
        raise InputError(f"{path}: expected records of at most {_MAX_BYTES} bytes, found more")
    records = []
    for number, line in enumerate(content.splitlines()):
        try:
            record = json.loads(line)
        except (ValueError, RecursionError):
            record = None
        fault = _record_fault(record)
        if fault or record["episode"] != number:
            raise InputError(
                f"{path}: expected the record of episode {number} in line {number + 1}, "
                f"found {fault or 'episode ' + str(record['episode'])}"
            )
        records.append(record)
    return records


def _is_int(value: Any) -> bool:
    return type(value) is int and value >= 0


def _is_cell(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(map(_is_int, value))


def _is_length(value: Any) -> bool:
    return type(value) in (int, float) and 0 <= value < math.inf


def _is_share(value: Any) -> bool:
    return type(value) in (int, float) and 0 <= value <= 1


_FIELDS: dict[str, Callable[[Any], bool]] = {
    "episode": _is_int,
    "maze": lambda value: isinstance(value, str),
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
    kinds = {"agent": str, "task": str, "size": int, "split": str, "benchmark": str, "episodes": int}
    for name, kind in {**kinds, "perturbation": dict, "provenance": dict, "overall": dict}.items():
        if not isinstance(summary.get(name), kind):
            return f"{name} {str(summary.get(name))[:60]!r}"
    if summary["episodes"] < 1:
        return f"{summary['episodes']} episodes"
    wrong = [key for key in ("success_rate", "spl", "spl_grid") if not _is_share(summary["overall"].get(key))]
    return f"overall {wrong[0]} {summary['overall'].get(wrong[0])!r}" if wrong else None


def _what_is_in(folder: pathlib.Path) -> str:
    if not folder.exists():
        return "nothing there"
    if not folder.is_dir():
        return "a file"
    names = sorted(path.name for path in folder.iterdir())
    if CONFIG in names:
        return "one that is not finished; go on with `mazebench eval` and --resume"
    return f"{names[0]!r} in it" if names else "an empty folder"
