"""Training runs of one agent, pooled.

`E` is the number of episodes of a result.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from mazebench.errors import InputError
from mazebench.evaluation.comparison import pool_runs
from mazebench.records import Record
from mazebench.report.results import METRICS, Result, Setting
from mazebench.report.table import Cell, Column

NOTE = (
    "Mean and interquartile mean of the mazes' scores in all runs, with 95 % intervals by a bootstrap of the runs of "
    "each maze: of other training runs on these mazes. Empty without two runs of the same episodes."
)
_FIELDS = ("start", "goal", "distance", "seed", "success", "spl", "spl_grid")


def training_runs(results: Sequence[Result]) -> dict[str, list[Result]]:
    """The results of one agent's training runs, by agent, of those agents that have several.

    A run is a checkpoint, or a seed where there is none. A checkpoint evaluated with several seeds is one run: the
    lowest seed counts.
    """
    agents = {agent: _runs(results, agent) for agent in dict.fromkeys(result.agent for result in results)}
    return {agent: runs for agent, runs in agents.items() if len({_run(result) for result in runs}) > 1}


def pool_columns(
    agent: str, runs: Sequence[Result], rows: Sequence[Callable[[Result], np.ndarray]]
) -> tuple[Column, Column]:
    """The agent's mean and its interquartile mean; a row chooses episodes (`[E]` bool) of the `runs`, or none."""
    pools = {
        metric: [_pool([_records(run, chosen) for run in runs if (chosen := row(run)).any()], metric) for row in rows]
        for metric in METRICS
    }
    mean, iqm = ({metric: tuple(pair[kind] for pair in pairs) for metric, pairs in pools.items()} for kind in (0, 1))
    return Column(f"{agent}, mean", False, mean), Column(f"{agent}, IQM", False, iqm)


def _run(result: Result) -> tuple[str | None, int]:
    return result.checkpoint, 0 if result.checkpoint else result.seed


def _runs(results: Sequence[Result], agent: str) -> list[Result]:
    """One result for each setting and run of an agent."""
    kept: dict[tuple[Setting, tuple[str | None, int]], Result] = {}
    for result in sorted(results, key=lambda result: result.seed):
        if result.agent == agent:
            kept.setdefault((result.setting, _run(result)), result)
    return list(kept.values())


def _pool(runs: Sequence[Sequence[Record]], metric: str) -> tuple[Cell | None, Cell | None]:
    """Mean and interquartile mean; none of runs that can't be pooled."""
    try:
        pooled = pool_runs(runs, metric)
    except InputError:
        return None, None
    counts = {"episodes": sum(map(len, runs)), "runs": len(runs)}
    (mean_low, mean_high), (iqm_low, iqm_high) = pooled["mean_ci95"], pooled["iqm_ci95"]
    return Cell(pooled["mean"], mean_low, mean_high, **counts), Cell(pooled["iqm"], iqm_low, iqm_high, **counts)


def _records(result: Result, chosen: np.ndarray) -> list[Record]:
    """The `chosen` episodes as records of what tells them apart and what they scored."""
    episodes = result.episodes
    columns = {"episode": np.arange(len(episodes)), "maze": np.array(episodes.mazes)[episodes.maze]}
    columns |= {name: getattr(episodes, name) for name in _FIELDS}
    values = zip(*(column[chosen].tolist() for column in columns.values()), strict=True)
    return [dict(zip(columns, row, strict=True)) for row in values]
