"""Finished evaluations as a report reads them, and all their episodes in one table."""

from __future__ import annotations

import dataclasses
import functools
import os
import pathlib
from collections.abc import Hashable, Iterable, Sequence

import numpy as np
import pandas as pd

from mazebench.errors import InputError, remark
from mazebench.maps.real_buildings import PREFIX, is_real
from mazebench.results.metrics import by_fact, scores
from mazebench.results.naming import described, order, own_in_words, setting_of
from mazebench.results.played import Shown, played_task, shown_of
from mazebench.results.reading import EPISODES, JOURNAL, SHARDS, SUMMARY, Result, load_result
from mazebench.results.records import Summary
from mazebench.results.trajectories import TRAJECTORIES, Trajectory, load_trajectories
from mazebench.tasks.episode import Episode
from mazebench.tasks.task import Task
from mazebench.tasks.task_options import CUSTOM, HIERARCHICAL, LOCAL, TaskOptions


@dataclasses.dataclass(frozen=True, eq=False)
class ReportedResult:
    """A finished evaluation that a report is made from. Two are equal if they are the same object."""

    folder: pathlib.Path
    summary: Summary
    label: str  # the agent's name, with the training run if results are of several
    setting: TaskOptions  # of which results are compared, see `setting_of`
    episodes: pd.DataFrame  # a row for each record in protocol order; the metrics are columns
    facts: tuple[str, ...]  # columns of bools: what a track says of episodes, as "blocked" and "not blocked"
    task: Task | None  # None if its mazes are gone
    trajectories: list[Trajectory] | None  # None if none were recorded, or the task is not known
    maps: dict[Hashable, list[Shown]] = dataclasses.field(default_factory=dict)  # that results of equal trials share

    @property
    def run(self) -> str:
        """The training run of the agent: the checkpoint, or the seed where there is none."""
        checkpoint = self.summary.provenance.checkpoint_sha256
        return checkpoint[:8] if checkpoint else f"seed {self.summary.provenance.seed}"

    @functools.cached_property
    def shown(self) -> list[Shown]:
        """The map shown to the agent in each episode; empty if the task is not known."""
        if self.task is None:
            return []
        indices = {maze.name: index for index, maze in enumerate(self.task.arena.fixed_mazes)}
        legs = list(zip(*(self.episodes[name] for name in ("maze", "start", "goal", "seed")), strict=True))
        key = self.summary.task, self.summary.provenance.mazes_sha256, tuple(legs)
        if key in self.maps:
            return self.maps[key]
        shown = self.maps.setdefault(key, [])
        for number, (maze, *ends, seed) in enumerate(legs):
            _, start, goal, _ = legs[number - number % self.setting.num_goals]  # of the episode
            shown.append(shown_of(self.task, Episode(indices[maze], start, goal, 0.0, seed), ends))
        return shown

    @functools.cached_property
    def walls(self) -> dict[str, np.ndarray]:
        """The walls `[N, N]` bool of the mazes by their names; none if the task is not known."""
        return {maze.name: maze.walls for maze in self.task.arena.fixed_mazes} if self.task else {}


def read_results(paths: Sequence[pathlib.Path]) -> list[ReportedResult]:
    """Returns all results at or below `paths`, one for each setting and training run, sorted by setting; at least one.

    It warns with a `Remark` of each thing that is skipped.

    Args:
      paths: evaluation folders, or folders above them.

    Raises:
      InputError: if there is no result.
    """
    results, maps = [], dict[Hashable, list[Shown]]()
    for path in paths:
        if not _find_evaluations([path]):
            remark(f"{path}: expected results of `mazebench eval`, found none; skipped")
    for folder in _find_evaluations(paths):
        try:
            results.append(dataclasses.replace(reported(load_result(folder)), maps=maps))
        except InputError as error:
            remark(f"{error}; skipped")
    if not results:
        where = ", ".join(map(str, paths))
        raise InputError(f"expected results of `mazebench eval` in {where}, found none to report")

    # Labels tell the training runs of an agent apart, where there are several.
    runs = pd.DataFrame([(result.label, result.run) for result in results]).groupby(0)[1].nunique()
    results = [
        dataclasses.replace(result, label=f"{result.label} {result.run}") if runs[result.label] > 1 else result
        for result in results
    ]

    # Of each label and setting, the result with the most episodes stays, the first of equals.
    kept: dict[tuple[str, TaskOptions, str], ReportedResult] = {}
    for result in sorted(results, key=lambda each: -len(each.episodes)):
        building = str(result.summary.task.mazes) if is_real(result.setting.mazes) else ""
        other = kept.setdefault((result.label, result.setting, building), result)
        if other is not result:
            remark(f"{result.folder}: {result.label}, {described(result.setting)} again, as in {other.folder}; skipped")
    return sorted((result for result in results if result in kept.values()), key=lambda result: order(result.setting))


def join_episodes(results: Sequence[ReportedResult]) -> pd.DataFrame:
    """Returns the episodes of all results below one another.

    It adds columns to those of `ReportedResult.episodes`: the `result` and the `number` of the episode in it; the
    agent's `label` (ordered as `results`), `agent` (its name) and `run`; the `setting` (ordered), its fields and
    perturbations, and its `mazes` in words; and numbers of the maze and of the `trial`: episodes with one maze, start,
    goal and seed are one trial.
    """
    labels = list(dict.fromkeys(result.label for result in results))
    settings = sorted({result.setting for result in results}, key=order)
    episodes = pd.concat(
        [
            result.episodes.assign(
                result=result,
                number=range(len(result.episodes)),
                label=pd.Categorical([result.label] * len(result.episodes), labels, ordered=True),
                agent=result.summary.who,
                run=result.run,
                is_untrained=result.summary.untrained_scale,
                setting=pd.Categorical([result.setting] * len(result.episodes), settings, ordered=True),
                mazes=_mazes_in_words(result),
                is_exact=result.setting.is_exact,
                task=HIERARCHICAL if result.setting.is_hierarchical else LOCAL,
                size=result.setting.size,
                landmark_distance=result.setting.landmark_distance if result.setting.is_hierarchical else 0,
                track=result.setting.track or "",
                level=result.setting.track_level,
                num_goals=result.setting.num_goals,
                **result.setting.perturbations,
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


def common_distances(episodes: pd.DataFrame) -> list[int]:
    """Returns the distances from start to goal that every result has, in cells.

    There are none in the hierarchical task and in real buildings, each of which has its own.
    """
    if episodes.task.eq("hierarchical").any() or any(is_real(setting.mazes) for setting in episodes.setting.unique()):
        return []
    num_results = episodes.groupby("distance").result.nunique()
    return num_results.index[num_results == episodes.result.nunique()].tolist()


def at_common_distances(episodes: pd.DataFrame) -> pd.DataFrame:
    """Returns the episodes at the distances that every result has; all episodes if there are no such distances."""
    common = common_distances(episodes)
    return episodes[episodes.distance.isin(common)] if common else episodes


def _find_evaluations(paths: Iterable[pathlib.Path]) -> list[pathlib.Path]:
    """Returns the evaluation folders at or below `paths`, also unfinished ones; each once, none hidden, no shards."""
    found: dict[pathlib.Path, pathlib.Path] = {}
    for path in paths:
        for folder, subfolders, files in os.walk(path):
            if not {SUMMARY, EPISODES, JOURNAL}.isdisjoint(files):
                found.setdefault(pathlib.Path(folder).resolve(), pathlib.Path(folder))
            subfolders[:] = sorted(name for name in subfolders if not name.startswith(".") and name != SHARDS)
    return list(found.values())


def reported(result: Result) -> ReportedResult:
    """Returns an evaluation as a report reads it, and warns with a `Remark` of what can't be shown of it.

    Raises:
      InputError: if the benchmark has other mazes than those that were played.
    """
    folder, summary, records = result.folder, result.summary, result.records
    task: Task | None = None
    try:
        task = played_task(summary)
    except InputError as error:
        if summary.task.split_in_results != CUSTOM:
            raise InputError(f"{folder}: {error}") from error
        remark(f"{folder}: {error}; reported without mazes and paths")
    of_trials, outcomes = ("maze", "start", "goal", "distance", "seed", "oracle_steps"), ("success", "steps")
    fields = (*of_trials, *outcomes, "path_length", "shortest_path")
    episodes = pd.DataFrame([[getattr(record, name) for name in fields] for record in records], columns=fields)
    episodes["distance"] = [record.asked_distance for record in records]
    facts = by_fact(records)
    episodes = episodes.assign(**scores(records), **facts)
    setting = setting_of(summary.task)
    if setting.mazes is not None and not is_real(setting.mazes):  # by their names, wherever the files were
        shown = None if setting.shown is None else "an older map"
        setting = setting.replace(mazes=", ".join(sorted(episodes.maze.unique())), shown=shown)

    trajectories: list[Trajectory] | None = None
    path = folder / TRAJECTORIES
    if task and path.exists():
        try:
            trajectories = load_trajectories(path)
            if [len(each.pose) for each in trajectories] != (episodes.steps + 1).tolist():
                raise InputError(f"{path}: expected a pose for the start and for each step, found others")
        except InputError as error:
            remark(f"{error}; reported without paths")
            trajectories = None
    return ReportedResult(folder, summary, summary.who, setting, episodes, tuple(facts), task, trajectories)


def _mazes_in_words(result: ReportedResult) -> str:
    """Returns the set of mazes, and what else a user chose; an empty text for the benchmark's eval mazes."""
    split, words = result.setting.split_in_results, own_in_words(result.setting)
    if is_real(result.setting.mazes):
        words = (f"real buildings ({result.setting.mazes.removeprefix(PREFIX)})", *words)
    if split == CUSTOM:
        names = sorted(result.episodes.maze.unique())
        words = (f"mazes {', '.join(names[:3])}" + (f" and {len(names) - 3} more" if len(names) > 3 else ""), *words)
    elif split != "eval":
        words = (f"{split} mazes", *words)
    return ", ".join(words)
