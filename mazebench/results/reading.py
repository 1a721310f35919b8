"""Finished evaluations read back from disk, by one rule: a summary that contradicts its records is refused."""

from __future__ import annotations

import dataclasses
import pathlib
from typing import Annotated, TypeVar

import numpy as np
import pydantic

from mazebench.errors import InputError, describe_fault
from mazebench.results.metrics import Steps, scores, spl
from mazebench.results.records import Record, Summary, column
from mazebench.storage.files import read_at_most
from mazebench.storage.json_files import read_lines

CONFIG = "config.json"
JOURNAL = "journal.jsonl"
EPISODES = "episodes.jsonl"
SUMMARY = "summary.json"
ORACLE = "oracle.json"
SUITE = "suite.json"

_Model = TypeVar("_Model", bound=pydantic.BaseModel)

_MAX_SUMMARY_BYTES = 2**22  # a summary takes some 20 KB
_TOLERANCE = 1e-6  # of figures that are computed again


@dataclasses.dataclass(frozen=True)
class Result:
    """A finished evaluation."""

    folder: pathlib.Path
    summary: Summary
    records: tuple[Record, ...]  # in protocol order
    oracle_steps: Steps | None = None  # the oracle's steps in these episodes; None in folders of earlier versions


class _OracleSteps(pydantic.BaseModel):
    """The content of `oracle.json`."""

    model_config = pydantic.ConfigDict(strict=True)

    steps: tuple[Annotated[int, pydantic.Field(ge=1)] | None, ...]  # of each episode; None where it missed the goal


FolderName = Annotated[str, pydantic.Field(pattern=r"^[\w-][\w.-]*$")]


class Suite(pydantic.BaseModel):
    """The content of `suite.json`: which parts and agents a suite's folder holds."""

    model_config = pydantic.ConfigDict(frozen=True, strict=True)

    suite: str
    parts: tuple[FolderName, ...]
    benchmark: str
    benchmark_manifest_sha256: str
    seed: int
    agents: tuple[str, ...]
    folders: dict[str, FolderName]  # by agent


def load_result(folder: pathlib.Path) -> Result:
    """Returns the finished evaluation in `folder`; changes nothing there.

    Raises:
      InputError: if there is none, it is damaged, or its summary contradicts its records.
    """
    if not (folder / SUMMARY).is_file():
        raise InputError(f"{folder}: expected a finished evaluation, found {_describe_content(folder)}")
    summary = _read_model(folder / SUMMARY, Summary, "an evaluation's summary")
    records = _read_records(folder / EPISODES)
    oracle_steps = read_oracle_steps(folder, summary.episodes)
    fault = _contradiction(summary, records, oracle_steps)
    if fault:
        raise InputError(f"{folder}: {SUMMARY} contradicts {EPISODES}: {fault}")
    return Result(folder, summary, records, oracle_steps)


def read_oracle_steps(folder: pathlib.Path, num_episodes: int) -> Steps | None:
    """Returns the oracle's steps in the episodes of an evaluation; None if its folder does not tell them.

    Raises:
      InputError: if the file is damaged or of another number of episodes.
    """
    path = folder / ORACLE
    if not path.exists():
        return None
    steps = _read_model(path, _OracleSteps, "the oracle's steps").steps
    if len(steps) != num_episodes:
        raise InputError(f"{path}: expected the oracle's steps in {num_episodes} episodes, found {len(steps)}")
    return steps


def read_suite(folder: pathlib.Path) -> Suite:
    """Returns what a suite's folder says of its content.

    Raises:
      InputError: if it says nothing that makes sense.
    """
    return _read_model(folder / SUITE, Suite, "a suite's parts and folders")


def find_parts(folder: pathlib.Path) -> dict[str, pathlib.Path]:
    """Returns the finished evaluations that a folder stands for, by their parts' names; "" if it is itself one.

    Raises:
      InputError: if it is a suite's with several agents, or nothing in it is finished.
    """
    names: list[str]
    if (folder / SUITE).is_file():
        suite = read_suite(folder)
        agents = list(suite.folders.values())
        if len(agents) != 1:
            named = ", ".join(str(folder / agent) for agent in agents)
            raise InputError(
                f"{folder}: expected one agent's results, found {len(agents)} agents'; name one of: {named}"
            )
        names, folder = list(suite.parts), folder / agents[0]
    elif (folder / SUMMARY).exists():
        return {"": folder}
    else:
        # In the suite's order where the folder is an agent's in one.
        ordered = read_suite(folder.parent).parts if (folder.parent / SUITE).is_file() else ()
        found = sorted(path.parent.name for path in folder.glob(f"*/{SUMMARY}"))
        names = list(dict.fromkeys([*(name for name in ordered if name in found), *found]))
    parts = {name: folder / name for name in names if (folder / name / SUMMARY).exists()}
    if not parts:
        raise InputError(f"{folder}: expected a finished evaluation, found {_describe_content(folder)}")
    return parts


def _read_model(path: pathlib.Path, model: type[_Model], kind: str) -> _Model:
    content = read_at_most(path, _MAX_SUMMARY_BYTES, "file")
    try:
        return model.model_validate_json(content)
    except pydantic.ValidationError as error:
        raise InputError(f"{path}: expected {kind}, found {describe_fault(error)}") from error


def _read_records(path: pathlib.Path) -> tuple[Record, ...]:
    records = []
    for number, line in enumerate(read_lines(path)):
        try:
            record = Record.model_validate_json(line)
        except pydantic.ValidationError as error:
            raise InputError(f"{path}: line {number + 1}: expected a record, found {describe_fault(error)}") from error
        if record.episode != number:
            raise InputError(f"{path}: line {number + 1}: expected episode {number}, found {record.episode}")
        records.append(record)
    return tuple(records)


def _contradiction(summary: Summary, records: tuple[Record, ...], oracle_steps: Steps | None) -> str | None:
    """Returns the first way in which records are not those that a summary was made from, in words."""
    if len(records) != summary.episodes:
        return f"expected {summary.episodes} records, found {len(records)}"
    same = ("agent", "task", "size", "split", "cell_size", "track", "level", "lidar_noise", "odometry_noise")
    expected = {key: getattr(summary, key) for key in same} | summary.perturbation
    for record in records:
        found = vars(record) | (record.model_extra or {})  # `getattr` is slow for what pydantic has as extra
        for key, value in expected.items():
            if found.get(key) != value:
                return f"expected {key} {value!r} in episode {record.episode}, found {found.get(key)!r}"
    success, driven = column(records, "success"), column(records, "path_length")
    for name, shortest, metres in (("spl", "shortest_path", 1.0), ("spl_grid", "distance", summary.cell_size or 1.0)):
        scores = spl(success, column(records, shortest) * metres, driven)
        wrong = np.flatnonzero(np.abs(scores - column(records, name)) > _TOLERANCE)
        if len(wrong):
            return f"expected {name} {scores[wrong[0]]:.6f} by the lengths of episode {wrong[0]}, found another"
    return _wrong_mean(summary, records, oracle_steps)


def _wrong_mean(summary: Summary, records: tuple[Record, ...], oracle_steps: Steps | None) -> str | None:
    distance = column(records, "distance")
    groups = {"overall": (summary.overall, np.ones(len(records), dtype=bool))}
    for key in np.unique(distance).tolist():
        if str(key) not in summary.by_distance:
            return f"expected figures of distance {key}, found none"
        groups[f"distance {key}"] = summary.by_distance[str(key)], distance == key
    found = scores(records, oracle_steps)
    for name, (figures, chosen) in groups.items():
        for metric, value in figures.means.items():
            mean = float(found[metric][chosen].mean()) if metric in found else value
            if abs(value - mean) > _TOLERANCE:
                return f"{metric} of {name} is {value:.6f}, by the records {mean:.6f}"
    return None


def _describe_content(folder: pathlib.Path) -> str:
    if not folder.exists():
        return "nothing there"
    if not folder.is_dir():
        return "a file"
    names = sorted(path.name for path in folder.iterdir())
    if CONFIG in names:
        return "one that is not finished; go on with `mazebench eval` and --resume"
    return f"{names[0]!r} in it" if names else "an empty folder"
