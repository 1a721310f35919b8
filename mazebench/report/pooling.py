"""Training runs of one agent, pooled, and held against those of another.

`R` is the number of training runs, `T` of mazes.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import pandas as pd

from mazebench.report.frame import Rows, rows_by, rows_by_distance, rows_by_level, settings_of
from mazebench.report.settings import Setting, level_name
from mazebench.report.table import METRICS, Cell, Column, Table
from mazebench.results.intervals import Estimate, pool_runs, probability_of_improvement

NOTE = (
    "Mean and interquartile mean (IQM) of the mazes' scores in all training runs; P(A > B) is the share of pairs of "
    "runs in which A's score of a maze is higher, ties counting half. 95 % intervals by a bootstrap over whole runs: "
    "they speak of other training runs on these mazes, and with fewer than 5 runs they are too narrow. Empty without "
    "two runs of the same episodes."
)
_IDENTITY = ["maze", "start", "goal", "distance", "seed"]  # what tells an episode from others


@dataclasses.dataclass(frozen=True)
class Runs:
    """The training runs of one agent in the same episodes."""

    episodes: pd.DataFrame  # the columns `_IDENTITY` of the episodes that each run played
    scores: dict[str, np.ndarray]  # [R, T] by metric: the mean over the episodes of each maze


def pooled_tables(episodes: pd.DataFrame) -> Iterator[Table]:
    """Yields a table for each task, size and perturbation of which an agent has several training runs."""
    kinds: dict[Setting, list[Setting]] = {}
    for setting in settings_of(episodes):
        kinds.setdefault(_kind(setting), []).append(setting)
    for kind in sorted(kinds):
        of_runs = training_runs(episodes[episodes.setting.isin(kinds[kind])])
        row_name, rows = _rows(of_runs, kind)
        columns = tuple(pool_columns(list(of_runs.agent.unique()), rows))
        if any(any(column.cells["success_rate"]) for column in columns):
            what = f"{kind.task.capitalize()} navigation, {kind.size} × {kind.size}"
            parts = [f"Track {kind.track}" if kind.track else what]
            parts += [f"{level_name(name)} {level:g}" for name, level in kind.perturbations]
            title = ", ".join([*parts, "pooled over training runs"])
            yield Table(f"pooled-{kind.track or kind.name}", title, NOTE, row_name, tuple(rows), (), columns)


def training_runs(episodes: pd.DataFrame) -> pd.DataFrame:
    """Returns the episodes of those agents that have several training runs.

    A run is a checkpoint, or a seed where there is none. A checkpoint evaluated with several seeds is one run: the
    lowest seed counts.
    """
    ordered = episodes.sort_values("run_seed", kind="stable")
    results = ordered.drop_duplicates(["agent", "setting", "run"]).result
    kept = ordered[ordered.result.isin(results)]
    return kept[kept.groupby("agent").run.transform("nunique") > 1]


def pool_columns(agents: Sequence[str], rows: Rows) -> Iterator[Column]:
    """Yields each agent's mean and interquartile mean, then P(A > B) of each two agents, with a cell for each row."""
    found = [{agent: _runs(episodes[episodes.agent == agent]) for agent in agents} for episodes in rows.values()]

    def column(label: str, sides: Sequence[str], estimate: Callable[..., Estimate]) -> Column:
        cells = {
            metric: tuple(_cell([runs[agent] for agent in sides], metric, estimate) for runs in found)
            for metric in METRICS
        }
        return Column(label, False, cells)

    for agent in agents:
        yield column(f"{agent}, mean", [agent], lambda scores: pool_runs(scores)[0])
        yield column(f"{agent}, IQM", [agent], lambda scores: pool_runs(scores)[1])
    for a, b in itertools.combinations(agents, 2):
        yield column(f"P({a} > {b})", [a, b], probability_of_improvement)


def _kind(setting: Setting) -> Setting:
    """Returns what all rows of a table have in common."""
    kind = dataclasses.replace(setting, landmark_distance=0)
    return dataclasses.replace(kind, size=0, level=0) if kind.track else kind


def _rows(episodes: pd.DataFrame, kind: Setting) -> tuple[str, Rows]:
    """Returns what the rows differ in, and the rows."""
    if kind.track:
        return "level", rows_by_level(episodes)
    if kind.task == "local":
        return "distance", rows_by_distance(episodes)
    return "landmark distance", rows_by(episodes, "landmark_distance")


def _runs(episodes: pd.DataFrame) -> Runs | None:
    """Returns the runs of an agent in a row; None if there are less than two, or they differ in their episodes."""
    runs = [run for _, run in episodes.groupby("run", sort=False)]
    if len(runs) < 2:
        return None
    first, *others = (run[_IDENTITY].reset_index(drop=True) for run in runs)
    if not all(other.equals(first) for other in others):
        return None
    means = [run.groupby("maze", sort=False)[list(METRICS)].mean() for run in runs]
    return Runs(first, {metric: np.array([of_run[metric] for of_run in means]) for metric in METRICS})


def _cell(sides: Sequence[Runs | None], metric: str, estimate: Callable[..., Estimate]) -> Cell | None:
    """Returns an estimate over the runs of one agent or two; None where they were not in the same episodes."""
    runs = [side for side in sides if side is not None]
    if len(runs) < len(sides) or not all(side.episodes.equals(runs[0].episodes) for side in runs):
        return None
    if any(np.isnan(side.scores[metric]).any() for side in runs):  # the oracle's steps are not known
        return None
    found = estimate(*(side.scores[metric] for side in runs))
    num_runs = sum(len(side.scores[metric]) for side in runs)
    return Cell(found.value, found.low, found.high, num_runs * len(runs[0].episodes), num_runs)
