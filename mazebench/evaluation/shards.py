"""Shares of a run: commands run one each, in `DIR/shards/NUMBER`, and `merge` makes the run in `DIR` of them.

The folder of a share is that of a run with fewer episodes. `DIR/shards/NUMBER.json` says that it has ended.
"""

from __future__ import annotations

import os
import pathlib
import re
import shutil
from collections.abc import Sequence

import pydantic

from mazebench.errors import InputError
from mazebench.evaluation.eval_options import Shard
from mazebench.evaluation.store import check_same_run, is_finished, write_results
from mazebench.results import metrics
from mazebench.results.reading import CONFIG, SHARDS, SUITE, Result, load_result, read_model, read_suite
from mazebench.results.records import Summary, counts_in
from mazebench.results.trajectories import TRAJECTORIES, Trajectory, load_trajectories
from mazebench.storage.files import locked, make_folder, writing_to
from mazebench.storage.json_files import read_json, write_json

_OF_ARRAYS = "SLURM_ARRAY_TASK_ID", "SLURM_ARRAY_TASK_COUNT"


class _Ended(pydantic.BaseModel):
    """The content of the file of a share that has ended."""

    model_config = pydantic.ConfigDict(strict=True, extra="forbid")

    of: int


def read_shard(text: str) -> Shard:
    """Returns the share called NUMBER/OF or, for `slurm`, that of this task of an array of Slurm's.

    Raises:
      InputError: if there is no such share.
    """
    name, found = "--shard", text
    if text == "slurm":
        name, found = " / ".join(_OF_ARRAYS), "/".join(os.environ.get(each, "") for each in _OF_ARRAYS)
    numbers = re.fullmatch(r"(\d{1,6})/(\d{1,6})", found)
    if numbers is None or not 1 <= int(numbers[1]) <= int(numbers[2]):
        raise InputError(f"expected {name} from 1/N to N/N, found {found!r}")
    return Shard(int(numbers[1]), int(numbers[2]))


def shard_folder(out: pathlib.Path, shard: Shard) -> pathlib.Path:
    """Returns the folder of a share of the run in `out`.

    Raises:
      InputError: if a share of the same number has ended there, of a run that was cut into another number.
    """
    folder = out / SHARDS / str(shard.number)
    if (file := folder.with_suffix(".json")).exists() and (of := read_model(file, _Ended, "a shard's").of) != shard.of:
        raise InputError(f"{folder}: holds shard {shard.number}/{of}, this one is {shard.number}/{shard.of}")
    return folder


def end_shard(folder: pathlib.Path, shard: Shard) -> None:
    """Writes that the share in `folder` has ended."""
    make_folder(folder)
    with writing_to(folder):
        write_json(folder.with_suffix(".json"), {"of": shard.of})


def merge(folder: pathlib.Path) -> list[Result]:
    """Makes the run in `folder` of its shares and returns its results; finished evaluations stay as they are.

    The files are those of a run by one command, but for the command and the machine in the summaries.

    Raises:
      InputError: if a share is missing, or they do not belong together; the message names it.
    """
    parts, names = _ended_shards(folder), [pathlib.Path()]
    if (parts[0] / SUITE).exists():
        suite = read_suite(parts[0])
        for other in [*parts[1:], *([folder] if (folder / SUITE).exists() else [])]:
            if read_suite(other) != suite:
                raise InputError(f"{other / SUITE}: expected the content of {parts[0] / SUITE}, found another one")
        with writing_to(folder):
            shutil.copyfile(parts[0] / SUITE, folder / SUITE)
        names = [pathlib.Path(agent, part) for agent in suite.folders.values() for part in suite.parts]
    shares = {name: [part / name for part in parts if (part / name / CONFIG).exists()] for name in names}
    if not any(shares.values()):
        raise InputError(f"{folder}: expected evaluations in its shards, found none")
    return [_merge_evaluation(folder / name, found) for name, found in shares.items() if found]


def _ended_shards(folder: pathlib.Path) -> list[pathlib.Path]:
    """Returns the folders of all shares of a run, in order."""
    files = [path for path in folder.glob(f"{SHARDS}/*.json") if path.stem.isdecimal()]
    ended = {int(path.stem): read_model(path, _Ended, "a shard's").of for path in files}
    if not ended:
        raise InputError(f"{folder}: expected shards that have ended, found none")
    of = max(ended.values())
    for number, other in sorted(ended.items()):
        if other != of:
            raise InputError(f"{folder}: expected {of} shards, found shard {number}/{other} of another run")
    if missing := ", ".join(str(number) for number in range(1, of + 1) if number not in ended):
        raise InputError(f"{folder}: expected {of} shards that have ended, found {len(ended)}; missing: {missing}")
    return [folder / SHARDS / str(number) for number in range(1, of + 1)]


def _merge_evaluation(folder: pathlib.Path, parts: Sequence[pathlib.Path]) -> Result:
    """Writes an evaluation of which `parts` hold the episodes, and returns it."""
    results = [load_result(part) for part in parts]
    first, identity = results[0].summary, read_json(parts[0] / CONFIG)
    for other in [*parts[1:], *([folder] if (folder / CONFIG).exists() else [])]:
        check_same_run(other, identity)
    for result in results:
        for name, version in result.summary.provenance.packages.items():
            if version != (expected := first.provenance.packages.get(name)):
                raise InputError(f"{result.folder}: expected {name} {expected} as in {parts[0]}, found {version}")
    if is_finished(folder):
        return load_result(folder)

    records = [record for result in results for record in result.records]
    order = sorted(range(len(records)), key=lambda number: (records[number].episode, records[number].leg))
    records = [records[number] for number in order]
    trajectories: list[Trajectory] = []
    if (parts[0] / TRAJECTORIES).exists():
        unordered = [each for part in parts for each in load_trajectories(part / TRAJECTORIES)]
        if len(unordered) != len(records):
            raise InputError(f"{folder}: expected {len(records)} trajectories in its shards, found {len(unordered)}")
        trajectories = [unordered[number] for number in order]
    num_goals = first.task.num_goals
    if [record.episode for record in records] != [number // num_goals for number in range(len(records))]:
        raise InputError(f"{folder}: expected each episode in one of its shards, found some in none or in several")
    changed = {"episodes": len(records) // num_goals, "counts": counts_in(records), **metrics.summarize(records)}
    summary = Summary(**dict(first) | changed)
    with locked(folder, "evaluation"), writing_to(folder):
        for path in (parts[0] / CONFIG, *parts[0].glob("pair*.png")):
            shutil.copyfile(path, folder / path.name)
        write_results(folder, records, trajectories, summary)
    return load_result(folder)
