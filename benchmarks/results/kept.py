"""The evaluations that are kept in archives, an archive for each folder of results."""

from __future__ import annotations

import dataclasses
import pathlib
import tarfile
import tempfile
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from mazebench.errors import InputError
from mazebench.report.frame import join_episodes
from mazebench.report.report import read_in_order
from mazebench.report.table import Table
from mazebench.report.tables import build_tables
from mazebench.results.intervals import Estimate, mean_interval
from mazebench.results.metrics import ON_TIME_METRICS, scores
from mazebench.results.reading import CONFIG, EPISODES, ORACLE, SUITE, SUMMARY, Result, load_result
from mazebench.results.records import column
from mazebench.storage.files import make_folder, open_whole
from mazebench.tasks.tracks import TRACKS, tracks_of
from mazebench.tasks.tracks.base import LEVELS

PAPER, V3 = "paper", "v3"  # the suites
LOCAL = "local-13"  # the part of `paper` that other training runs of an agent play, too
TRACKS_V3 = tracks_of(V3)
ON_TIME_125, ON_TIME_2 = ON_TIME_METRICS  # within 1.25 and 2 times the oracle's steps
# Agents, with what they were told less or more than others.
NAVIGATOR, NO_MAP, TRUE_POSE = "navigator", "navigator without map", "navigator with the true pose"
BELIEF_PLANNER, BELIEF_RULE = "belief-planner", "belief-rule"

_SUFFIX = ".tar.xz"
_RUNS = f"runs{_SUFFIX}"  # other training runs of agents that ship
_KEPT_FILES = (CONFIG, EPISODES, ORACLE, SUMMARY)


@dataclasses.dataclass(frozen=True)
class Kept:
    """The evaluations that are kept."""

    results: dict[tuple[str, str], Result]  # by row of the agent, and part of a suite
    report: dict[str, Table]  # tables of the report of the suite `paper`, by name
    episodes: pd.DataFrame  # of that report
    others: dict[str, list[Result]]  # by row of an agent, of its training runs that do not ship, on the part `LOCAL`

    def runs(self, row: str) -> list[Result]:
        """Returns the evaluations of all training runs of an agent on the part `LOCAL`, that which ships first."""
        return [self.result(row, LOCAL), *self.others.get(row, ())]

    def result(self, row: str, part: str) -> Result:
        """Returns the evaluation of an agent on a part of a suite.

        Raises:
          InputError: if it is not kept.
        """
        if (row, part) not in self.results:
            raise InputError(f"expected an evaluation of {row} on {part} among the records, found none")
        return self.results[row, part]

    def levels(self, row: str, track: str) -> list[Result]:
        """Returns an agent's evaluations at the levels of a track; none with the true pose on a track that tells it.

        Raises:
          InputError: if one is not kept.
        """
        if row == TRUE_POSE and not TRACKS[track].hides_pose(LEVELS[0]):
            return []
        return [self.result(row, f"{track}-{level}") for level in LEVELS]


def read_kept(folder: pathlib.Path) -> Kept:
    """Returns the evaluations in all archives of `folder`.

    Raises:
      InputError: if two are of the same agent and part, one is damaged, or none is of the suite `paper`.
    """
    results: dict[tuple[str, str], Result] = {}
    others: dict[str, list[Result]] = {}
    with tempfile.TemporaryDirectory() as temporary:
        for path in sorted(folder.glob(f"*{_SUFFIX}")):
            with tarfile.open(path) as archive:
                archive.extractall(pathlib.Path(temporary, path.name), filter="data")
        for summary in sorted(pathlib.Path(temporary).rglob(SUMMARY)):
            result = load_result(summary.parent)
            if _RUNS in summary.parts:
                others.setdefault(result.summary.row, []).append(result)
                continue
            key = result.summary.row, result.summary.part or summary.parent.name
            if key in results:
                archives = [each.folder.relative_to(temporary).parts[0] for each in (results[key], result)]
                raise InputError(f"expected one evaluation of {key[0]} on {key[1]}, found two: {', '.join(archives)}")
            results[key] = result
        paper = [result.folder for result in results.values() if result.summary.suite == PAPER]
        if not paper:
            raise InputError(f"{folder}: expected records of the suite {PAPER!r}, found none")
        episodes = join_episodes(*read_in_order(paper))
    return Kept(results, {table.name: table for table in build_tables(episodes)}, episodes, others)


def keep(folder: pathlib.Path, records: pathlib.Path) -> pathlib.Path:
    """Writes an archive of the finished evaluations in `folder` into `records`, in the place of one of its name.

    Equal evaluations give equal bytes.

    Raises:
      InputError: if nothing in the folder is finished.
    """
    folder = folder.resolve()
    finished = sorted(path.parent for path in folder.rglob(SUMMARY))
    if not finished:
        raise InputError(f"{folder}: expected finished evaluations, found none")
    paths = [path for each in finished for name in _KEPT_FILES if (path := each / name).exists()]
    paths += sorted(folder.rglob(SUITE))
    make_folder(records)
    target = records / f"{folder.name}{_SUFFIX}"
    with open_whole(target) as file, tarfile.open(fileobj=file, mode="w:xz", preset=9) as archive:
        for path in paths:
            entry = tarfile.TarInfo(f"{folder.name}/{path.relative_to(folder).as_posix()}")
            entry.size = path.stat().st_size
            with path.open("rb") as content:
                archive.addfile(entry, content)
    return target


def estimate(result: Result, metric: str, field: str = "", values: Sequence[Any] = ()) -> Estimate | None:
    """Returns the mean of a metric with its interval; None if there are no episodes to count.

    Args:
      result: an evaluation.
      metric: as in a summary, or `ON_TIME_125` or `ON_TIME_2`.
      field: of a record; all episodes count if it is empty, else those that have one of `values` there.
      values: of the field.
    """
    counted = np.isin(column(result.records, field), values) if field else np.ones(len(result.records), dtype=bool)
    if not counted.any():
        return None
    return mean_interval(
        scores(result.records, result.oracle_steps)[metric][counted], column(result.records, "maze")[counted]
    )
