"""Finished evaluations as a report reads them, and all their episodes in one table."""

from __future__ import annotations

import dataclasses
import functools
import os
import pathlib
from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd

from mazebench.errors import InputError, remark, unknown
from mazebench.results.metrics import by_fact, scores
from mazebench.results.played import Shown, played_task, shown_of
from mazebench.results.reading import EPISODES, JOURNAL, SUMMARY, Result, load_result
from mazebench.results.records import Summary
from mazebench.results.trajectories import TRAJECTORIES, Trajectory, load_trajectories
from mazebench.tasks.episode import Episode
from mazebench.tasks.task import Task
from mazebench.tasks.task_options import CUSTOM, HIERARCHICAL, LOCAL, TaskOptions

# What `ReportedResult.episodes` says of each episode: fields of its record. Facts of a track are further columns.
_OF_RECORDS = [
    *("maze", "start", "goal", "distance", "success", "steps", "path_length", "shortest_path", "spl", "spl_grid"),
    "seed",
]
# Where well-known agents stand among others.
_AGENT_ORDER = ("oracle", "navigator", "mmn", "mah", "mah-paper", "dqn", "planner-closed-loop", "planner", "random")


@dataclasses.dataclass(frozen=True, eq=False)
class ReportedResult:
    """A finished evaluation that a report is made from. Two are equal if they are the same object."""

    folder: pathlib.Path
    summary: Summary
    label: str  # the agent's name in the report, with more where the name alone is ambiguous
    setting: TaskOptions  # of which results are compared, see `TaskOptions.setting`
    episodes: pd.DataFrame  # a row for each episode in protocol order; the metrics are columns
    facts: tuple[str, ...]  # columns of bools: what a track says of episodes, as "blocked" and "not blocked"
    task: Task | None  # None if its mazes are gone
    trajectories: list[Trajectory] | None  # None if none were recorded, or the task is not known

    @property
    def name(self) -> str:
        """The agent's name, with what sets the result apart from the agent's others."""
        return self.summary.who

    @property
    def checkpoint(self) -> str | None:
        """The SHA-256 of the checkpoint."""
        return self.summary.provenance.checkpoint_sha256

    @property
    def seed(self) -> int:
        """The seed of the run."""
        return self.summary.provenance.seed

    @property
    def run(self) -> str:
        """The key of a training run of an agent: the checkpoint, or the seed where there is none."""
        return self.checkpoint or f"seed {self.seed}"

    @functools.cached_property
    def mazes(self) -> dict[str, int]:
        """The indices of the task's mazes by their names; none if the task is not known."""
        return {maze.name: index for index, maze in enumerate(self.task.fixed_mazes)} if self.task else {}

    @functools.cached_property
    def shown(self) -> list[Shown]:
        """The map shown to the agent in each episode; empty if the task is not known."""
        if self.task is None:
            return []
        columns = (self.episodes[name] for name in ("maze", "start", "goal", "seed"))
        return [
            shown_of(self.task, Episode(self.mazes[maze], start, goal, 0.0, seed))
            for maze, start, goal, seed in zip(*columns, strict=True)
        ]

    def walls(self, maze: str) -> np.ndarray | None:
        """Returns `[N, N]` bool, a maze; None if the task is not known."""
        return self.task.mazes[self.mazes[maze]].walls if self.task else None


def read_results(paths: Iterable[pathlib.Path], names: Sequence[tuple[str, str]] = ()) -> list[ReportedResult]:
    """Returns all results at or below `paths`, one for each setting and agent, in this order; at least one.

    It warns with a `Remark` of each thing that is skipped.

    Args:
      paths: evaluation folders, or folders above them.
      names: what agents are called in the report: pairs of a name and an agent, or the folder of an agent's results.

    Raises:
      InputError: if there is no result, or a name fits no agent.
    """
    results = []
    for folder in _find_folders(paths):
        try:
            results.append(_read_result(folder))
        except InputError as error:
            remark(f"{error}; skipped")
    if not results:
        where = ", ".join(map(str, paths))
        raise InputError(f"expected results of `mazebench eval` or `mazebench train` in {where}, found none to report")
    results = _drop_repeats(_label(_rename(results, names)))
    return sorted(results, key=lambda result: (result.setting, _rank(result.label)))


def join_episodes(results: Sequence[ReportedResult]) -> pd.DataFrame:
    """Returns the episodes of all results below one another, in the order of `results`.

    It adds columns to those of `ReportedResult.episodes`: the `result` and the `number` of the episode in it; the
    agent's `label` (ordered), `agent` (its name), `run` and `run_seed`; the `setting` (ordered) and its fields; and
    numbers of the maze and of the `trial`: episodes with one maze, start, goal and seed are one trial.
    """
    labels = sorted({result.label for result in results}, key=_rank)
    settings = sorted({result.setting for result in results})
    episodes = pd.concat(
        [
            result.episodes.assign(
                result=result,
                number=range(len(result.episodes)),
                label=pd.Categorical([result.label] * len(result.episodes), labels, ordered=True),
                agent=result.name,
                run=result.run,
                run_seed=result.seed,
                is_untrained=result.summary.untrained_scale,
                setting=pd.Categorical([result.setting] * len(result.episodes), settings, ordered=True),
                is_exact=result.setting.is_exact,
                task=HIERARCHICAL if result.setting.is_hierarchical else LOCAL,
                size=result.setting.size,
                split=result.setting.split_in_results,
                landmark_distance=result.setting.landmark_distance if result.setting.is_hierarchical else 0,
                track=result.setting.track or "",
                level=result.setting.track_level,
            )
            for result in results
        ],
        ignore_index=True,
    )
    episodes["maze_index"] = pd.factorize(episodes.maze)[0]
    episodes["trial"] = episodes.groupby(["maze", "start", "goal", "seed"], sort=False).ngroup()
    for fact in facts_of(episodes):
        episodes[fact] = episodes[fact].eq(True)  # no value where a result doesn't tell it
    return episodes


def facts_of(episodes: pd.DataFrame) -> list[str]:
    """Returns the columns that are facts of a track."""
    return list(dict.fromkeys(fact for result in episodes.result.unique() for fact in result.facts))


def settings_of(episodes: pd.DataFrame) -> list[TaskOptions]:
    """Returns the settings of which there are episodes, sorted."""
    return sorted(episodes.setting.unique())


def common_distances(episodes: pd.DataFrame) -> list[int]:
    """Returns the distances from start to goal that every result has, in cells; none for the hierarchical task."""
    if episodes.task.eq("hierarchical").any():
        return []
    num_results = episodes.groupby("distance").result.nunique()
    return num_results.index[num_results == episodes.result.nunique()].tolist()


def at_common_distances(episodes: pd.DataFrame) -> pd.DataFrame:
    """Returns the episodes at the distances that every result has; all episodes if there are no such distances."""
    common = common_distances(episodes)
    return episodes[episodes.distance.isin(common)] if common else episodes


def folders_below(path: pathlib.Path) -> list[pathlib.Path]:
    """Returns the evaluation folders at or below a path, by name. Hidden folders are left out."""
    folders = []
    for folder, subfolders, files in os.walk(path):
        subfolders[:] = sorted(name for name in subfolders if not name.startswith("."))
        if {SUMMARY, EPISODES, JOURNAL} & set(files):
            folders.append(pathlib.Path(folder))
    return folders


def _find_folders(paths: Iterable[pathlib.Path]) -> list[pathlib.Path]:
    """Returns the evaluation folders at or below `paths`, each once."""
    found: dict[pathlib.Path, pathlib.Path] = {}
    for path in paths:
        folders = folders_below(path)
        if not folders:
            remark(f"{path}: expected results of `mazebench eval`, found none; skipped")
        for folder in folders:
            found.setdefault(folder.resolve(), folder)
    return list(found.values())


def _rank(label: str) -> tuple[int, str]:
    name = label.partition(" ")[0]
    return (_AGENT_ORDER.index(name) if name in _AGENT_ORDER else len(_AGENT_ORDER), label)


def _read_result(folder: pathlib.Path) -> ReportedResult:
    result = load_result(folder)
    summary = result.summary
    task: Task | None = None
    try:
        task = played_task(summary)
    except InputError as error:
        if summary.task.split_in_results != CUSTOM:
            raise InputError(f"{folder}: {error}") from error
        remark(f"{folder}: {error}; reported without mazes and paths")
    episodes, facts = _to_table(result)
    trajectories = _read_trajectories(folder, episodes) if task else None
    setting = summary.task.setting
    if setting.mazes is not None:  # by their names, wherever the files were
        setting = setting.replace(mazes=", ".join(sorted(episodes.maze.unique())))
    return ReportedResult(folder, summary, summary.agent, setting, episodes, facts, task, trajectories)


def _to_table(result: Result) -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Returns the episodes, and which columns are facts."""
    episodes = pd.DataFrame(
        [[getattr(record, name) for name in _OF_RECORDS] for record in result.records], columns=_OF_RECORDS
    )
    facts = by_fact(result.records)
    return episodes.assign(**scores(result.records), **facts), tuple(facts)


def _read_trajectories(folder: pathlib.Path, episodes: pd.DataFrame) -> list[Trajectory] | None:
    """Returns the trajectories if the folder has some that fit the records."""
    path = folder / TRAJECTORIES
    if not path.exists():
        return None
    try:
        trajectories = load_trajectories(path)
    except InputError as error:
        remark(f"{error}; reported without paths")
        return None
    if [len(each.pose) for each in trajectories] != (episodes.steps + 1).tolist():
        remark(f"{path}: expected a pose for the start and for each step, found others; reported without paths")
        return None
    return trajectories


def _rename(results: list[ReportedResult], names: Sequence[tuple[str, str]]) -> list[ReportedResult]:
    agents = [result.summary.agent for result in results]
    renamed = list(agents)
    for name, what in names:
        folder = pathlib.Path(what).resolve()
        chosen = [place for place, agent in enumerate(agents) if agent == what] or [
            place for place, result in enumerate(results) if result.folder.resolve().is_relative_to(folder)
        ]
        if not chosen:
            raise unknown("agent or folder", what, set(agents))
        for place in chosen:
            renamed[place] = name
    for name, _ in names:
        called = sorted({agent for agent, now in zip(agents, renamed, strict=True) if now == name})
        if len(called) > 1:
            raise InputError(f"expected one agent called {name!r}, found {', '.join(called)}")
    return [
        dataclasses.replace(result, summary=result.summary.model_copy(update={"agent": name}))
        for result, name in zip(results, renamed, strict=True)
    ]


def _label(results: list[ReportedResult]) -> list[ReportedResult]:
    """Returns the results with labels that tell all agents apart: by checkpoint and seed where names are equal."""
    labelled = []
    for result in results:
        namesakes = [other for other in results if other.name == result.name]
        label = result.name
        if len({other.checkpoint for other in namesakes}) > 1:
            label += f" {result.checkpoint[:6]}" if result.checkpoint else " without checkpoint"
        if len({other.seed for other in namesakes}) > 1:
            label += f" seed {result.seed}"
        labelled.append(dataclasses.replace(result, label=label))
    return labelled


def _drop_repeats(results: list[ReportedResult]) -> list[ReportedResult]:
    """Returns one result for each agent and setting: the one with the most episodes, the first of equals."""
    kept: dict[tuple[str, TaskOptions], ReportedResult] = {}
    for result in results:
        other = kept.setdefault((result.label, result.setting), result)
        if other is result:
            continue
        more, less = (result, other) if len(result.episodes) > len(other.episodes) else (other, result)
        remark(f"{less.folder}: {less.label}, {less.setting} again, as in {more.folder}; skipped")
        kept[result.label, result.setting] = more
    return list(kept.values())
