"""The evaluations and training runs that are kept in archives, an archive for each folder of them."""

from __future__ import annotations

import dataclasses
import functools
import pathlib
import tarfile
import tempfile
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from mazebench_agents.common.checkpoint import AGENT_FILE

from mazebench.errors import InputError
from mazebench.report.curves import SUCCESS, Run, read_run
from mazebench.report.episodes import join_episodes, read_results
from mazebench.report.table import Table
from mazebench.report.tables import build_tables
from mazebench.results.comparison import check_pairs
from mazebench.results.intervals import Estimate, mean_interval
from mazebench.results.metrics import ON_TIME_METRICS, scores
from mazebench.results.reading import CONFIG, EPISODES, SUITE, SUMMARY, Result, load_result
from mazebench.results.records import column
from mazebench.storage.files import make_folder, open_whole
from mazebench.tasks.tracks import LEVELS, TRACKS
from mazebench.training.run_folder import METRICS, checkpoints

PAPER = "paper"  # the suite
LOCAL = "local-13"  # the part of `paper` on which training runs are evaluated
ON_TIME_125, ON_TIME_2 = ON_TIME_METRICS  # within 1.25 and 2 times the oracle's steps
# Agents, with what they were told less or more than others.
NAVIGATOR, NO_MAP, TRUE_POSE = "navigator", "navigator without map", "navigator with the true pose"
RANDOM = "random"
# Agents of several training runs each.
LEARNED, REWARDED = "neural-planner", "neural-planner from rewards"
REWARDED_BUILDING = "neural-planner from rewards on building"
WAYS = "mmn-paths"
PATHS = {"path on the map open": False, "path on the map blocked": True}  # whether a record is of a blocked one

_SUFFIX = ".tar.xz"
_TRAINING = "training"  # the folder of archives of training runs
_RUNS = f"runs{_SUFFIX}"  # evaluations of training runs, in folders NAME-SEED
# Evaluations of several training runs, in folders RUN/PART, by the name of their archive.
_SEVERAL = {
    "tracks-neural-planner": LEARNED,
    "tracks-neural-planner-rewards": REWARDED,
    "tracks-neural-planner-building": REWARDED_BUILDING,
    "mmn-paths-sizes": WAYS,
    "tracks-mmn-paths": WAYS,
}
_KEPT_FILES = (CONFIG, EPISODES, SUMMARY)


@dataclasses.dataclass(frozen=True)
class Kept:
    """The evaluations that are kept."""

    results: dict[tuple[str, str], Result]  # by row of the agent, and part of a suite
    report: dict[str, Table]  # tables of the report of the suite `paper`, by name
    episodes: pd.DataFrame  # of that report
    runs: dict[str, list[Result]]  # of training runs on the part `LOCAL`, by name of the agent that was trained
    training: dict[str, list[Run]]  # what training runs logged, by name of the archive
    several: dict[tuple[str, str], list[Result]] = dataclasses.field(default_factory=dict)  # as `results`, of each run

    def training_runs(self, name: str) -> list[Result]:
        """Returns the evaluations of an agent's training runs, two at least, in the same episodes.

        Raises:
          InputError: if fewer are kept, one is of other episodes, or two are of one checkpoint.
        """
        found = self.runs.get(name, [])
        checkpoints = {each.summary.provenance.checkpoint_sha256 for each in found}
        if len(checkpoints) < max(2, len(found)):
            of = f"{len(found)} of {len(checkpoints)} checkpoints"
            raise InputError(f"expected evaluations of several training runs {name}, found {of}")
        for each in found[1:]:
            check_pairs(found[0], each)
        return found

    def curves(self, name: str) -> list[Run]:
        """Returns what the training runs of an archive logged."""
        if name not in self.training:
            raise InputError(f"expected training runs {name} among the records, found none")
        return self.training[name]

    def milestones(self, name: str) -> pd.DataFrame:
        """Returns what an archive's training runs logged at the milestones that all of them reached, a line each.

        The index has millions of agent steps, rounded to a tenth.
        """
        runs = []
        for run in self.curves(name):
            lines = run.lines[run.lines.filter(like=SUCCESS).notna().any(axis=1)]
            lines = lines.set_index((lines.env_steps / 1e6).round(1))
            runs.append(lines[~lines.index.duplicated(keep="last")])
        common = functools.reduce(pd.Index.intersection, (run.index for run in runs))
        return pd.concat([run.loc[common] for run in runs])

    def success_rates(self, name: str, distance: int) -> dict[float, list[float]]:
        """Returns the success rates on watched mazes at the `milestones`."""
        rates = self.milestones(name)[f"{SUCCESS}{distance}"]
        return {steps: of_runs.tolist() for steps, of_runs in rates.groupby(level=0)}

    def result(self, row: str, part: str) -> Result:
        """Returns the evaluation of an agent on a part of a suite."""
        if (row, part) not in self.results:
            raise InputError(f"expected an evaluation of {row} on {part} among the records, found none")
        return self.results[row, part]

    def levels(self, row: str, track: str) -> list[list[Result]]:
        """Returns an agent's evaluations at the levels of a track, of each training run; none where it has none.

        It has none with the true pose on a track that tells it.
        """
        if row == TRUE_POSE and not TRACKS[track].hides_pose:
            return []
        if row in _SEVERAL.values():
            return [self.several[row, part] for level in LEVELS if (row, part := f"{track}-{level}") in self.several]
        return [[self.result(row, f"{track}-{level}")] for level in LEVELS]


def read_kept(folder: pathlib.Path) -> Kept:
    """Returns what all archives of `folder` hold, and those of training runs in its folder `training`.

    Raises:
      InputError: if two evaluations are of the same agent and part, one is damaged, or none is of the suite `paper`.
    """
    results: dict[tuple[str, str], Result] = {}
    runs: dict[str, list[Result]] = {}
    several: dict[tuple[str, str], list[Result]] = {}
    training: dict[str, list[Run]] = {}
    with tempfile.TemporaryDirectory() as temporary:
        unpacked = pathlib.Path(temporary)
        for path in sorted(folder.rglob(f"*{_SUFFIX}")):
            with tarfile.open(path) as archive:
                archive.extractall(unpacked / path.relative_to(folder), filter="data")

        for config in sorted((unpacked / _TRAINING).rglob(CONFIG)):
            name = config.relative_to(unpacked / _TRAINING).parts[0].removesuffix(_SUFFIX)
            if run := read_run(config.parent, config.parent.name):
                training.setdefault(name, []).append(run)

        for summary in sorted(unpacked.rglob(SUMMARY)):
            result = load_result(summary.parent)
            if _RUNS in summary.parts:
                runs.setdefault(summary.parent.name.rpartition("-")[0], []).append(result)
                continue
            if row := _SEVERAL.get(summary.relative_to(unpacked).parts[0].removesuffix(_SUFFIX)):
                several.setdefault((row, summary.parent.name), []).append(result)
                continue
            key = result.summary.row, result.summary.part or summary.parent.name
            if key in results:
                archives = [each.folder.relative_to(unpacked).parts[0] for each in (results[key], result)]
                raise InputError(f"expected one evaluation of {key[0]} on {key[1]}, found two: {', '.join(archives)}")
            results[key] = result
        paper = [result.folder for result in results.values() if result.summary.suite == PAPER]
        if not paper:
            raise InputError(f"{folder}: expected records of the suite {PAPER!r}, found none")
        episodes = join_episodes(read_results(paper))
    return Kept(results, {table.name: table for table in build_tables(episodes)}, episodes, runs, training, several)


def keep(folder: pathlib.Path, records: pathlib.Path) -> pathlib.Path:
    """Writes an archive of the finished evaluations in `folder` into `records`, in the place of one of its name.

    A folder without any may hold training runs. Their configs, curves and last checkpoints go to `records/training`.
    Equal contents give equal bytes.
    """
    folder = folder.resolve()
    finished = sorted(path.parent for path in folder.rglob(SUMMARY))
    if finished:
        paths = [path for each in finished for name in _KEPT_FILES if (path := each / name).exists()]
        paths += sorted(folder.rglob(SUITE))
        return _archive(folder, paths, records)
    runs = sorted(path.parent for path in folder.rglob(METRICS))
    if not runs:
        raise InputError(f"{folder}: expected finished evaluations or training runs, found neither")
    paths = [run / name for run in runs for name in (CONFIG, METRICS)]
    paths += [last / AGENT_FILE for run in runs for last in checkpoints(run)[-1:]]
    return _archive(folder, paths, records / _TRAINING)


def _archive(folder: pathlib.Path, paths: Sequence[pathlib.Path], target: pathlib.Path) -> pathlib.Path:
    """Writes files of `folder` into an archive of its name in the folder `target`."""
    make_folder(target)
    path = target / f"{folder.name}{_SUFFIX}"
    with open_whole(path) as file, tarfile.open(fileobj=file, mode="w:xz", preset=9) as archive:
        for each in paths:
            entry = tarfile.TarInfo(f"{folder.name}/{each.relative_to(folder).as_posix()}")
            entry.size = each.stat().st_size
            with each.open("rb") as content:
                archive.addfile(entry, content)
    return path


def all_episodes(kept: Kept) -> pd.DataFrame:
    """Returns a line for each episode of all evaluations, with the steps of the agent and of the oracle.

    `run` is the first 8 digits of the checkpoint's SHA-256, empty without a checkpoint.
    """
    several = ((row, part, result) for (row, part), results in kept.several.items() for result in results)
    runs = ((name, LOCAL, result) for name, results in kept.runs.items() for result in results)
    parts = []
    for row, part, result in (*((*key, result) for key, result in kept.results.items()), *several, *runs):
        columns = {name: column(result.records, name) for name in ("episode", "maze", "success", "steps")}
        oracle = [record.oracle_steps for record in result.records]
        origin = {"agent": row, "run": (result.summary.provenance.checkpoint_sha256 or "")[:8], "setting": part}
        parts.append(pd.DataFrame(origin | columns | {"oracle_steps": pd.array(oracle, dtype="Int64")}))
    return pd.concat(parts, ignore_index=True)


def mean_estimate(runs: Sequence[Result], metric: str, field: str = "", values: Sequence[Any] = ()) -> float | None:
    """Returns the mean of a metric over training runs in the same episodes; the rest as of `estimate`."""
    found = [estimate(result, metric, field, values) for result in runs]
    return None if None in found else float(np.mean([each.value for each in found if each]))


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
    return mean_interval(scores(result.records)[metric][counted], column(result.records, "maze")[counted])
