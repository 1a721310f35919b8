"""The evaluations and training runs that are kept in `records/`, in an archive for each folder of them."""

from __future__ import annotations

import dataclasses
import itertools
import pathlib
import shutil
import tarfile
import tempfile
from collections.abc import Iterator

import pandas as pd
from mazebench_agents.common.checkpoint import AGENT_FILE

from mazebench.errors import InputError
from mazebench.report.episodes import join_episodes, reported
from mazebench.report.table import Table
from mazebench.report.tables import build_tables
from mazebench.results.intervals import Estimate, runs_interval
from mazebench.results.metrics import ON_TIMES, scores
from mazebench.results.naming import order
from mazebench.results.reading import CONFIG, EPISODES, SUITE, SUMMARY, load_result
from mazebench.results.suite_groups import group_of
from mazebench.results.trajectories import TRAJECTORIES
from mazebench.storage.files import make_folder, open_whole
from mazebench.tasks.tracks import LEVELS, STANDING, TRACKS
from mazebench.training.run_folder import METRICS, checkpoints, read_metrics

PAPER = "paper"  # the suite
LOCAL = "local-13"  # the part of `paper` on which training runs are evaluated
ON_TIME_125, ON_TIME_2 = (metric.name for metric in ON_TIMES)  # within 1.25 and 2 times the oracle's steps
WORST_TENTH = "worst_tenth"  # on time in the tenth of the mazes with the lowest rates, after JaxNav; else missing
# The archive of evaluations whose records have the recall of poses, in folders AGENT/TRACK-LEVEL.
RECALL = "recall"
RECALL_AGENTS = ("navigator", "neural-planner")
RECALL_SETTINGS = (("building", 2), ("building", 3), ("adrift", 1), ("adrift", 2), ("adrift", 3))
LLM_DEV = "llm-dev"  # the archive of the suite on `dev`, whose parts are named as those of `llm`
REAL = "real"  # begins the names of archives of evaluations in real buildings; the group of a part is the setting
TURTLEBOT3 = "turtlebot3"  # the archive of evaluations of this body, on tracks and in real buildings
TOLD = "navigator-told"  # played `rebuilt` only
# The settings whose maps lie as the mazes do, with the same doors moved: those with a true pose and registration.
_REGISTERED = {
    "building": ("building-1", "building-1", "building-1"),
    "rebuilt": ("rebuilt-1", "rebuilt-2", "rebuilt-3"),
    "adrift": ("rebuilt-2", "rebuilt-2", "rebuilt-3"),
    "rough": ("rebuilt-1", "rebuilt-2", "rebuilt-2"),
}
PATHS = "paper-paths"  # the archive of evaluations of `PAPER`'s settings whose paths are kept, too
_SUFFIX = ".tar.xz"
SUCCESS = "success_rate_"  # begins the names of success rates in what training runs logged
_TRAINING = "training"  # the folder of archives of training runs
_RUNS = "runs"  # the archive of evaluations of training runs on `LOCAL`, in folders AGENT-SEED
# Of records.
_COLUMNS = [
    "episode", "maze", "distance", "success", "steps", "oracle_steps", "kind", "blocked", "leg", "after_miss", "notes",
    "path_length", "waited",
]  # fmt: skip
# Archives of evaluations with switches of their own, in folders ROW/SETTING: the agent is called ARCHIVE/ROW.
_SWITCHED = ("map-policy", "mmn-search", TURTLEBOT3)
# Archives whose agents have another name than their evaluations.
_AGENTS = {
    "tracks-neural-planner-rewards": "neural-planner from rewards",
    "tracks-neural-planner-hidden": "neural-planner trained without the map",
    "tracks-ppo-hidden": "PPO trained without the map",
    "doors-neural-planner": "neural-planner trained on doors",
}


def ceilings(track: str, level: int) -> dict[str, tuple[str, str]]:
    """Returns agents and settings that know more and more of the truth in a setting, by what they know."""
    setting, registered = f"{track}-{level}", _REGISTERED[track][level - 1]
    with_pose = "navigator with the true pose" if TRACKS[track].hides_pose else "navigator"
    return {
        "`navigator`": ("navigator", setting),
        "with the true pose": (with_pose, setting),
        "and the true registration": ("navigator", registered),
        "and all walls once blocked": (TOLD if registered.startswith("rebuilt") else "navigator", registered),
    }


@dataclasses.dataclass(frozen=True)
class Kept:
    """The kept evaluations and training runs."""

    # A line for each episode of an agent in a setting (its index), which is a part of a suite, by a checkpoint (`run`).
    episodes: pd.DataFrame
    report: dict[str, Table]  # tables of the report of the suite `paper`, by name
    training: dict[str, list[pd.DataFrame]]  # what training runs logged, by name of their archive
    # The episodes of the suite `paper` as a report has them, and likewise those whose paths are kept.
    paper: pd.DataFrame = dataclasses.field(default_factory=pd.DataFrame)
    paths: pd.DataFrame = dataclasses.field(default_factory=pd.DataFrame)
    read: set[str] = dataclasses.field(default_factory=set)  # the archives that a table was made from so far

    def of(self, agent: str, setting: str) -> pd.DataFrame:
        """Returns the episodes of an agent in a setting: those of its training runs where several are kept."""
        found = self.episodes.loc[agent, setting]
        runs = found[found.archive == _RUNS]
        found = found if runs.empty else runs
        self.read.update(found.archive)
        return found

    def find(self, agent: str, setting: str) -> pd.DataFrame | None:
        """Returns what `of` does; None if there are no such episodes."""
        return self.of(agent, setting) if (agent, setting) in self.episodes.index else None

    def on_tracks(self, agent: str) -> Iterator[tuple[str, int, pd.DataFrame]]:
        """Yields the tracks and levels on which an agent was evaluated, with its episodes there."""
        for track, level in itertools.product(STANDING, LEVELS):
            if (own := self.find(agent, f"{track}-{level}")) is not None:
                yield track, level, own

    def milestones(self, archive: str) -> pd.DataFrame:
        """Returns what an archive's training runs logged at the milestones that all of them reached, a line each.

        The index has millions of agent steps, rounded to a tenth.
        """
        runs = []
        self.read.add(f"{_TRAINING}/{archive}")
        for lines in self.training[archive]:
            lines = lines[lines.filter(like=SUCCESS).notna().any(axis=1)]
            lines = lines.set_index((lines.env_steps / 1e6).round(1))
            runs.append(lines[~lines.index.duplicated(keep="last")])
        lines = pd.concat(runs)
        return lines[lines.groupby(level=0).env_steps.transform("size") == len(runs)]

    def success_rates(self, archive: str, distance: int) -> pd.DataFrame:
        """Returns the mean, lowest and highest success rate over training runs on watched mazes at each milestone."""
        return self.milestones(archive)[f"{SUCCESS}{distance}"].groupby(level=0).agg(["mean", "min", "max"])


def estimate(metric: str, *agents: pd.DataFrame) -> Estimate:
    """Returns the mean of a metric over an agent's runs and mazes, or its difference to that of a second agent."""
    runs = [own.pivot(index="run", columns="episode", values=metric).to_numpy() for own in agents]
    mazes = agents[0].groupby("episode").maze.first().to_numpy()
    return runs_interval(runs[0], mazes, *runs[1:])


def read_kept(folder: pathlib.Path) -> Kept:
    """Returns what all archives of `folder` hold, and those of training runs in its folder `training`."""
    training: dict[str, list[pd.DataFrame]] = {}
    paper, paths, episodes = [], [], []
    with tempfile.TemporaryDirectory() as temporary:
        unpacked = pathlib.Path(temporary)
        for path in folder.rglob(f"*{_SUFFIX}"):
            shutil.unpack_archive(path, unpacked / path.relative_to(folder).parent, filter="data")
        for log in sorted((unpacked / _TRAINING).rglob(METRICS)):
            training.setdefault(log.relative_to(unpacked).parts[1], []).append(pd.DataFrame(read_metrics(log.parent)))

        # The evaluations of the paper's protocol as the report reads them, and the episodes of all evaluations.
        for path in sorted(unpacked.rglob(SUMMARY)):
            result = load_result(path.parent)
            summary, (archive, *folders) = result.summary, path.parent.relative_to(unpacked).parts
            if archive == PATHS:
                paths.append(reported(result))
                continue
            if summary.suite == PAPER:
                paper.append(reported(result))
            agent, setting = _AGENTS.get(archive, summary.row), summary.part or result.folder.name
            if archive in (RECALL, LLM_DEV):  # whose agents played settings of these names in other archives, too
                setting = f"{setting}-{archive}"
            if archive in _SWITCHED:
                agent, setting = f"{archive}/{folders[0]}", group_of(folders[1])
            if archive == _RUNS:
                agent, setting = result.folder.name.rpartition("-")[0], LOCAL
            lines = pd.DataFrame(list(map(dict, result.records)), columns=_COLUMNS).assign(**scores(result.records))
            if archive.startswith(REAL):
                agent, setting = summary.agent + "-camera" * archive.endswith("-camera"), group_of(setting)
            if archive.startswith(REAL) or archive == TURTLEBOT3:
                lines["episode"] = lines.maze + lines.episode.astype(str)
            rates = lines.groupby("maze")[ON_TIME_125].mean()
            lines[WORST_TENTH] = lines[ON_TIME_125].where(lines.maze.isin(rates.nsmallest(-(-len(rates) // 10)).index))
            run = (summary.provenance.checkpoint_sha256 or "")[:8]
            episodes.append(lines.assign(archive=archive, agent=agent, run=run, setting=setting))
    of_paper, of_paths = (join_episodes(sorted(each, key=lambda one: order(one.setting))) for each in (paper, paths))
    tables = build_tables(of_paper)
    joined = pd.concat(episodes).astype({"oracle_steps": "Int64"}).set_index(["agent", "setting"])
    return Kept(joined.sort_index(kind="stable"), {table.name: table for table in tables}, training, of_paper, of_paths)


def keep(folder: pathlib.Path, records: pathlib.Path) -> pathlib.Path:
    """Writes an archive of the evaluations in `folder` into `records`, in the place of one of its name.

    A folder without any may hold training runs. Their configs, curves and last checkpoints go to `records/training`.
    Equal contents give equal bytes. Of the folder `PATHS`, paths are kept, too.
    """
    folder = folder.resolve()
    are_evaluations = any(folder.rglob(SUMMARY))
    names = (
        (CONFIG, EPISODES, SUMMARY, SUITE, *[TRAJECTORIES] * (folder.name == PATHS))
        if are_evaluations
        else (CONFIG, METRICS)
    )
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
