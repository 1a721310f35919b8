"""The steps of the agent `oracle` in the frozen episodes, by which an episode is on time."""

from __future__ import annotations

import functools
import hashlib
import json
from collections.abc import Sequence
from importlib import resources

from mazebench.errors import InputError
from mazebench.maps.benchmark import manifest, read_asset
from mazebench.results.metrics import Steps
from mazebench.tasks.task import Task
from mazebench.tasks.trials import Trial, frozen_trials

# Of steps.json, which holds those of the paper's protocol. The manifest of the tracks names files of its own.
_SHA256 = "de3d76f36e3ee498c6d15bea88dcf52d2c5f88d3df90d956691048694976f274"


def frozen_oracle_steps(task: Task, trials: Sequence[Trial]) -> Steps | None:
    """Returns the oracle's steps in some trials; None unless all of them are frozen, and the oracle's steps, too."""
    if task.options.frozen_split is None:
        return None
    steps = _steps_by_seed(task.options.benchmark, task.interface.task, task.size, task.options.frozen_split)
    seeds = [trial.episode.seed for trial in trials]
    return tuple(steps[seed] for seed in seeds) if all(seed in steps for seed in seeds) else None


def oracle_file(task: str, size: int, split: str) -> str:
    """Returns the name of the file with the oracle's steps in the frozen episodes of one task, size and split."""
    return f"oracle-{task}-{size}-{split}.json"


def oracle_key(task: str, size: int) -> str:
    """Returns the name in `assets/oracle/steps.json` of the steps in a task's eval episodes."""
    return f"{task}-{size}"


@functools.cache
def _steps_by_seed(benchmark: str, task: str, size: int, split: str) -> dict[int, int | None]:
    """Returns the steps by the seed of the episode, which no two episodes of a task, size and split share."""
    name = oracle_file(task, size, split)
    if name in manifest(benchmark)["files"]:
        steps = json.loads(read_asset(name, benchmark))["steps"]
    else:
        steps = _first_steps().get(oracle_key(task, size), []) if split == "eval" else []
    seeds = [trial.episode.seed for trial in frozen_trials(task, size, benchmark, split)] if steps else []
    return dict(zip(seeds, steps, strict=True))


@functools.cache
def _first_steps() -> dict[str, list[int | None]]:
    """Returns the steps in the eval episodes of the paper's protocol.

    Raises:
      InputError: if the file was changed.
    """
    content = resources.files("mazebench_assets").joinpath("oracle", "steps.json").read_bytes()
    if (found := hashlib.sha256(content).hexdigest()) != _SHA256:
        raise InputError(f"oracle/steps.json was changed: expected SHA-256 {_SHA256}, found {found}")
    return json.loads(content)
