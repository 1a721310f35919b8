"""The evaluations and training runs that are kept in `records/`, in an archive for each folder of them."""

from __future__ import annotations

import functools
import pathlib
import tarfile
import tempfile
from typing import NamedTuple

import pandas as pd
from mazebench_agents.common.checkpoint import AGENT_FILE

from mazebench.errors import InputError
from mazebench.report.curves import SUCCESS
from mazebench.report.episodes import join_episodes, read_results
from mazebench.report.table import Table
from mazebench.report.tables import build_tables
from mazebench.results.intervals import Estimate, runs_interval
from mazebench.results.metrics import scores
from mazebench.results.reading import CONFIG, EPISODES, SUITE, SUMMARY, Result, load_result
from mazebench.results.records import column
from mazebench.storage.files import make_folder, open_whole
from mazebench.tasks.tracks import LEVELS
from mazebench.training.run_folder import METRICS, checkpoints, read_metrics

PAPER = "paper"  # the suite
LOCAL = "local-13"  # the part of `paper` on which training runs are evaluated
_SUFFIX = ".tar.xz"
_TRAINING = "training"  # the folder of archives of training runs
_RUNS = "runs"  # the archive of evaluations of training runs on `LOCAL`, in folders AGENT-SEED
# Archives whose agents have another name than their evaluations.
_AGENTS = {
    "tracks-neural-planner-rewards": "neural-planner from rewards",
    "tracks-neural-planner-building": "neural-planner from rewards on building",
}


class Kept(NamedTuple):
    """The kept evaluations and training runs."""

    # A line for each episode of an agent in a setting (its index), which is a part of a suite, by a checkpoint (`run`).
    episodes: pd.DataFrame
    report: dict[str, Table]  # tables of the report of the suite `paper`, by name
    training: dict[str, list[pd.DataFrame]]  # what training runs logged, by name of their archive

    def of(self, agent: str, setting: str) -> pd.DataFrame:
        """Returns the episodes of an agent in a setting: those of its training runs where several are kept."""
        if (agent, setting) not in self.episodes.index:
            raise InputError(f"expected an evaluation of {agent} on {setting} among the records, found none")
        found = self.episodes.loc[agent, setting]
        runs = found[found.archive == _RUNS]
        return found if runs.empty else runs

    def on_track(self, agent: str, track: str) -> dict[str, pd.DataFrame]:
        """Returns an agent's episodes in each setting of a track in which it was evaluated, as "rebuilt-2"."""
        settings = (f"{track}-{level}" for level in LEVELS)
        return {each: self.of(agent, each) for each in settings if (agent, each) in self.episodes.index}

    def milestones(self, archive: str) -> pd.DataFrame:
        """Returns what an archive's training runs logged at the milestones that all of them reached, a line each.

        The index has millions of agent steps, rounded to a tenth.
        """
        runs = []
        for lines in self.training[archive]:
            lines = lines[lines.filter(like=SUCCESS).notna().any(axis=1)]
            lines = lines.set_index((lines.env_steps / 1e6).round(1))
            runs.append(lines[~lines.index.duplicated(keep="last")])
        common = functools.reduce(pd.Index.intersection, (lines.index for lines in runs))
        return pd.concat([lines.loc[common] for lines in runs])

    def success_rates(self, archive: str, distance: int) -> pd.DataFrame:
        """Returns the mean, lowest and highest success rate over training runs on watched mazes at each milestone."""
        return self.milestones(archive)[f"{SUCCESS}{distance}"].groupby(level=0).agg(["mean", "min", "max"])


def estimate(own: pd.DataFrame, metric: str, other: pd.DataFrame | None = None) -> Estimate:
    """Returns the mean of a metric over the runs and mazes of some episodes, or its difference to that of others.

    The others are of the same episodes by another agent.
    """
    values = own.pivot(index="run", columns="episode", values=metric)
    others = None if other is None else other.pivot(index="run", columns="episode", values=metric).to_numpy()
    mazes = own.drop_duplicates("episode").set_index("episode").maze[values.columns]
    return runs_interval(values.to_numpy(), mazes.to_numpy(), others)


def read_kept(folder: pathlib.Path) -> Kept:
    """Returns what all archives of `folder` hold, and those of training runs in its folder `training`."""
    training: dict[str, list[pd.DataFrame]] = {}
    with tempfile.TemporaryDirectory() as temporary:
        unpacked = pathlib.Path(temporary)
        for path in folder.rglob(f"*{_SUFFIX}"):
            with tarfile.open(path) as archive:
                archive.extractall(unpacked / path.relative_to(folder).parent, filter="data")
        for log in sorted((unpacked / _TRAINING).rglob(METRICS)):
            training.setdefault(log.relative_to(unpacked).parts[1], []).append(pd.DataFrame(read_metrics(log.parent)))
        results = [load_result(path.parent) for path in sorted(unpacked.rglob(SUMMARY))]
        of_paper = {each.folder: each for each in results if each.summary.suite == PAPER}
        paper = join_episodes(read_results(list(of_paper), of_paper.__getitem__))
        lines = [_episodes(each, each.folder.relative_to(unpacked).parts[0]) for each in results]
    episodes = pd.concat(lines).set_index(["agent", "setting"]).sort_index(kind="stable")
    return Kept(episodes, {table.name: table for table in build_tables(paper)}, training)


def _episodes(result: Result, archive: str) -> pd.DataFrame:
    """Returns a line for each episode of an evaluation."""
    summary, records = result.summary, result.records
    agent, setting = _AGENTS.get(archive, summary.row), summary.part or result.folder.name
    if archive == _RUNS:
        agent, setting = result.folder.name.rpartition("-")[0], LOCAL
    facts = {"kind", "blocked"} & {*(records[0].model_extra or {})}  # on tracks
    columns = {name: column(records, name) for name in ("episode", "maze", "distance", "success", "steps", *facts)}
    columns["oracle_steps"] = pd.array([record.oracle_steps for record in records], dtype="Int64")
    run = (summary.provenance.checkpoint_sha256 or "")[:8]
    origin = {"archive": archive, "agent": agent, "run": run, "setting": setting}
    return pd.DataFrame(origin | columns | scores(records))


def keep(folder: pathlib.Path, records: pathlib.Path) -> pathlib.Path:
    """Writes an archive of the evaluations in `folder` into `records`, in the place of one of its name.

    A folder without any may hold training runs. Their configs, curves and last checkpoints go to `records/training`.
    Equal contents give equal bytes.
    """
    folder = folder.resolve()
    are_evaluations = any(folder.rglob(SUMMARY))
    names = (CONFIG, EPISODES, SUMMARY, SUITE) if are_evaluations else (CONFIG, METRICS)
    paths = sorted(path for name in names for path in folder.rglob(name))
    paths += [last / AGENT_FILE for path in paths if path.name == METRICS for last in checkpoints(path.parent)[-1:]]
    if not paths:
        raise InputError(f"{folder}: expected evaluations or training runs, found neither")
    target = records if are_evaluations else records / _TRAINING
    make_folder(target)
    archive_path = target / f"{folder.name}{_SUFFIX}"
    with open_whole(archive_path) as file, tarfile.open(fileobj=file, mode="w:xz", preset=9) as archive:
        for path in paths:
            entry = tarfile.TarInfo(f"{folder.name}/{path.relative_to(folder).as_posix()}")
            entry.size = path.stat().st_size
            with path.open("rb") as content:
                archive.addfile(entry, content)
    return archive_path
