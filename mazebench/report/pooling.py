"""Training runs of one agent, pooled, and held against those of another.

`E` is the number of episodes of a result, `R` of training runs, `T` of mazes.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from mazebench.report.results import METRICS, ReportedResult
from mazebench.report.rows import Row, distance_rows, level_rows, setting_rows
from mazebench.report.settings import Setting, level_name
from mazebench.report.table import Cell, Column, Table
from mazebench.results.intervals import Estimate, pool_runs, probability_of_improvement

NOTE = (
    "Mean and interquartile mean (IQM) of the mazes' scores in all training runs; P(A > B) is the share of pairs of "
    "runs in which A's score of a maze is higher, ties counting half. 95 % intervals by a bootstrap over whole runs: "
    "they speak of other training runs on these mazes, and with fewer than 5 runs they are too narrow. Empty without "
    "two runs of the same episodes."
)


def pooled_tables(results: Sequence[ReportedResult]) -> Iterator[Table]:
    """Yields a table for each task, size and perturbation of which an agent has several training runs."""
    for kind in sorted({_kind(result.setting) for result in results}):
        agents = training_runs([result for result in results if _kind(result.setting) == kind])
        row_name, rows = _rows([result for runs in agents.values() for result in runs], kind)
        columns = tuple(pool_columns(agents, [*rows.values()]))
        if any(any(column.cells["success_rate"]) for column in columns):
            what = f"{kind.task.capitalize()} navigation, {kind.size} × {kind.size}"
            parts = [f"Track {kind.track}" if kind.track else what]
            parts += [f"{level_name(name)} {level:g}" for name, level in kind.perturbations]
            title = ", ".join([*parts, "pooled over training runs"])
            yield Table(f"pooled-{kind.track or kind.name}", title, NOTE, row_name, tuple(rows), (), columns)


def training_runs(results: Sequence[ReportedResult]) -> dict[str, list[ReportedResult]]:
    """Returns the results of one agent's training runs, by agent, of those agents that have several.

    A run is a checkpoint, or a seed where there is none. A checkpoint evaluated with several seeds is one run: the
    lowest seed counts.
    """
    agents = {agent: _runs(results, agent) for agent in dict.fromkeys(result.name for result in results)}
    return {agent: runs for agent, runs in agents.items() if len({_run(result) for result in runs}) > 1}


def pool_columns(agents: Mapping[str, Sequence[ReportedResult]], rows: Sequence[Row]) -> Iterator[Column]:
    """Yields each agent's mean and interquartile mean, then P(A > B) of each two agents, with a cell for each row."""
    for agent, runs in agents.items():
        yield _column(f"{agent}, mean", [runs], rows, lambda scores: pool_runs(scores)[0])
        yield _column(f"{agent}, IQM", [runs], rows, lambda scores: pool_runs(scores)[1])
    for a, b in itertools.combinations(agents, 2):
        yield _column(f"P({a} > {b})", [agents[a], agents[b]], rows, probability_of_improvement)


def _kind(setting: Setting) -> Setting:
    """Returns what all rows of a table have in common."""
    kind = dataclasses.replace(setting, landmark_distance=0)
    return dataclasses.replace(kind, size=0, level=0) if kind.track else kind


def _rows(results: Sequence[ReportedResult], kind: Setting) -> tuple[str, dict[str, Row]]:
    """Returns what the rows differ in, and the rows."""
    if kind.track:
        return "level", level_rows(results)
    if kind.task == "local":
        return "distance", distance_rows(results)
    levels = sorted({result.setting.landmark_distance for result in results})
    rows = setting_rows(results, {level: str(level) for level in levels}, lambda setting: setting.landmark_distance)
    return "landmark distance", rows


def _column(
    label: str, sides: Sequence[Sequence[ReportedResult]], rows: Sequence[Row], estimate: Callable[..., Estimate]
) -> Column:
    """Returns `estimate` of the scores (`[R, T]`) of each of the `sides`, by metric and row."""
    cells = {metric: tuple(_cell(sides, row, metric, estimate) for row in rows) for metric in METRICS}
    return Column(label, False, cells)


def _cell(
    sides: Sequence[Sequence[ReportedResult]], row: Row, metric: str, estimate: Callable[..., Estimate]
) -> Cell | None:
    """Returns nothing where a side has less than two runs, or the runs differ in their episodes."""
    chosen = [[(run, row(run)) for run in side if row(run).any()] for side in sides]
    everything = list(itertools.chain(*chosen))
    if min(map(len, chosen)) < 2 or not _same_episodes(everything):
        return None
    found = estimate(*(np.array([_maze_scores(run, mask, metric) for run, mask in side]) for side in chosen))
    num_episodes = sum(int(mask.sum()) for _, mask in everything)
    return Cell(found.value, found.low, found.high, num_episodes, len(everything))


def _same_episodes(runs: Sequence[tuple[ReportedResult, np.ndarray]]) -> bool:
    first, *others = (_identity(run, mask) for run, mask in runs)
    return all(all(map(np.array_equal, first, other)) for other in others)


def _identity(run: ReportedResult, chosen: np.ndarray) -> list[np.ndarray]:
    """Returns `[E, ...]` each: what tells the chosen episodes from others."""
    episodes = run.episodes
    of_maze = np.array(episodes.mazes)[episodes.maze]
    return [column[chosen] for column in (of_maze, episodes.start, episodes.goal, episodes.distance, episodes.seed)]


def _maze_scores(run: ReportedResult, chosen: np.ndarray, metric: str) -> np.ndarray:
    """Returns `[T]`: the mean over the chosen episodes of each maze."""
    _, maze = np.unique(run.episodes.maze[chosen], return_inverse=True)
    return np.bincount(maze, weights=run.episodes.values(metric)[chosen]) / np.bincount(maze)


def _run(result: ReportedResult) -> tuple[str | None, int]:
    return result.checkpoint, 0 if result.checkpoint else result.seed


def _runs(results: Sequence[ReportedResult], agent: str) -> list[ReportedResult]:
    """Returns one result for each setting and run of an agent."""
    kept: dict[tuple[Setting, tuple[str | None, int]], ReportedResult] = {}
    for result in sorted(results, key=lambda result: result.seed):
        if result.name == agent:
            kept.setdefault((result.setting, _run(result)), result)
    return list(kept.values())
