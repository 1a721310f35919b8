"""Finished evaluations read back from disk."""

from __future__ import annotations

import dataclasses
import pathlib
from typing import Annotated, TypeVar

import pydantic

from mazebench.errors import InputError, describe_fault
from mazebench.results.records import Record, Summary
from mazebench.storage.files import open_file

CONFIG = "config.json"
JOURNAL = "journal.jsonl"
EPISODES = "episodes.jsonl"
SUMMARY = "summary.json"
SUITE = "suite.json"
SHARDS = "shards"  # the folder of the shares of a run

_Model = TypeVar("_Model", bound=pydantic.BaseModel)


@dataclasses.dataclass(frozen=True)
class Result:
    """A finished evaluation."""

    folder: pathlib.Path
    summary: Summary
    records: tuple[Record, ...]  # in protocol order, of several goals one of each


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
      InputError: if there is none, or a file of it is damaged.
    """
    if not (folder / SUMMARY).is_file():
        raise InputError(f"{folder}: expected a finished evaluation, found {_describe_content(folder)}")
    summary = read_model(folder / SUMMARY, Summary, "an evaluation's summary")
    with open_file(folder / EPISODES, "records") as file:
        lines = file.readlines()
    records = tuple(
        _validate(line, Record, f"{folder / EPISODES}: line {number}", "a record")
        for number, line in enumerate(lines, 1)
    )
    if len(records) != (expected := summary.episodes * summary.task.num_goals):
        raise InputError(f"{folder / EPISODES}: expected {expected} records, found {len(records)}")
    return Result(folder, summary, records)


def read_suite(folder: pathlib.Path) -> Suite:
    """Returns what a suite's folder says of its content."""
    return read_model(folder / SUITE, Suite, "a suite's parts and folders")


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
        names = [*ordered, *sorted(path.parent.name for path in folder.glob(f"*/{SUMMARY}"))]
    parts = {name: folder / name for name in names if (folder / name / SUMMARY).exists()}
    if not parts:
        raise InputError(f"{folder}: expected a finished evaluation, found {_describe_content(folder)}")
    return parts


def read_model(path: pathlib.Path, model: type[_Model], kind: str) -> _Model:
    """Returns the value in a JSON file, which a message calls a `kind`."""
    with open_file(path, "file") as file:
        return _validate(file.read(), model, str(path), kind)


def _validate(content: bytes, model: type[_Model], where: str, kind: str) -> _Model:
    try:
        return model.model_validate_json(content)
    except pydantic.ValidationError as error:
        raise InputError(f"{where}: expected {kind}, found {describe_fault(error)}") from error


def _describe_content(folder: pathlib.Path) -> str:
    if not folder.exists():
        return "nothing there"
    if not folder.is_dir():
        return "a file"
    names = sorted(path.name for path in folder.iterdir())
    if CONFIG in names:
        return "one that is not finished; go on with `mazebench eval` and --resume"
    return f"{names[0]!r} in it" if names else "an empty folder"
