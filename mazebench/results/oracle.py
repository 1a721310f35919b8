"""The SPL of the agent `oracle` in the frozen episodes, against which SPL is normalised."""

from __future__ import annotations

import functools
import json
from collections.abc import Sequence
from importlib import resources

from mazebench.maps.benchmark import VERSION
from mazebench.tasks.trials import Trial, frozen_trials


def oracle_spl(benchmark: str, task: str, size: int, trials: Sequence[Trial]) -> dict[int, float] | None:
    """Returns the oracle's SPL in each of some frozen trials, by index; None if one of them is not frozen."""
    table = _by_seed(benchmark, task, size)
    if not all(trial.episode.seed in table for trial in trials):
        return None
    return {index: table[trial.episode.seed] for index, trial in enumerate(trials)}


@functools.cache
def _by_seed(benchmark: str, task: str, size: int) -> dict[int, float]:
    """Returns the oracle's SPL by the seed of the episode, which no two frozen episodes of a task and size share."""
    text = resources.files("mazebench_assets").joinpath("oracle", "spl.json").read_text("utf-8")
    values = json.loads(text).get(oracle_key(benchmark, task, size), [])
    seeds = [trial.episode.seed for trial in frozen_trials(task, size, benchmark)] if values else []
    return dict(zip(seeds, values, strict=True))


def oracle_key(benchmark: str, task: str, size: int) -> str:
    """Returns the name of the list of the oracle's SPL in the frozen episodes of a benchmark, a task and a size."""
    return f"{task}-{size}" if benchmark == VERSION else f"{benchmark}-{task}-{size}"
