"""The evaluations that are kept in archives, an archive for each folder of results."""

from __future__ import annotations

import dataclasses
import io
import pathlib
import tarfile
import tempfile

import pandas as pd

from mazebench.errors import InputError
from mazebench.report.frame import join_episodes
from mazebench.report.report import read_in_order
from mazebench.report.table import Table
from mazebench.report.tables import build_tables
from mazebench.results.metrics import ON_TIME_METRICS
from mazebench.results.reading import CONFIG, EPISODES, ORACLE, SUITE, SUMMARY, Result, load_result
from mazebench.storage.files import open_whole
from mazebench.tasks.tracks import tracks_of

PAPER, V3 = "paper", "v3"  # the suites
TRACKS_V3 = tracks_of(V3)
IN_TIME, IN_DOUBLE_TIME = ON_TIME_METRICS  # by the smaller and the larger factor of the oracle's steps
# Agents, with what they were told less or more than others.
NAVIGATOR, NO_MAP, TRUE_POSE = "navigator", "navigator without map", "navigator with the true pose"
BELIEF_PLANNER, BELIEF_RULE = "belief-planner", "belief-rule"

_KEPT_FILES = (CONFIG, EPISODES, ORACLE, SUITE, SUMMARY)


@dataclasses.dataclass(frozen=True)
class Kept:
    """The evaluations that are kept."""

    results: dict[tuple[str, str], Result]  # by row of the agent, and part of a suite
    report: dict[str, Table]  # tables of the report of the suite `paper`, by name
    episodes: pd.DataFrame | None  # of that report; None if no such suite is kept


def read_kept(folder: pathlib.Path) -> Kept:
    """Returns the evaluations in all archives of `folder`.

    Raises:
      InputError: if two are of the same agent and part, or one is damaged.
    """
    results: dict[tuple[str, str], Result] = {}
    with tempfile.TemporaryDirectory() as temporary:
        for path in sorted(folder.glob("*.tar.xz")):
            with tarfile.open(path) as archive:
                archive.extractall(temporary, filter="data")
        for summary in sorted(pathlib.Path(temporary).rglob(SUMMARY)):
            result = load_result(summary.parent)
            key = result.summary.row, result.summary.part or summary.parent.name
            if key in results:
                raise InputError(f"{folder}: expected one evaluation of {key[0]} on {key[1]}, found two")
            results[key] = result
        paper = sorted(pathlib.Path(temporary).glob(f"{PAPER}*"))
        episodes = join_episodes(*read_in_order(paper)) if paper else None
    tables = [] if episodes is None else build_tables(episodes)
    return Kept(results, {table.name: table for table in tables}, episodes)


def keep(folder: pathlib.Path, records: pathlib.Path) -> pathlib.Path:
    """Writes an archive of the evaluations in `folder` into `records`; equal folders give equal bytes.

    Raises:
      InputError: if nothing in the folder is finished.
    """
    paths = sorted(path for path in folder.rglob("*") if path.name in _KEPT_FILES)
    if not any(path.name == SUMMARY for path in paths):
        raise InputError(f"{folder}: expected finished evaluations, found none")
    content = io.BytesIO()
    with tarfile.open(fileobj=content, mode="w:xz", preset=9) as archive:
        for path in paths:
            entry = tarfile.TarInfo(f"{folder.name}/{path.relative_to(folder).as_posix()}")
            entry.size = path.stat().st_size
            with path.open("rb") as file:
                archive.addfile(entry, file)
    records.mkdir(exist_ok=True)
    target = records / f"{folder.name}.tar.xz"
    with open_whole(target) as file:
        file.write(content.getvalue())
    return target
