"""Measures the steps of `oracle` in the episodes of an evaluation, where they are not frozen."""

from __future__ import annotations

from collections.abc import Sequence

from mazebench import stopping
from mazebench.agent_loading import load_agent_class
from mazebench.evaluation.chunk import run_trials
from mazebench.evaluation.eval_options import NUM_ENVS
from mazebench.results.metrics import Steps
from mazebench.tasks.task import Task
from mazebench.tasks.trials import Trial

ORACLE = "oracle"


def measure_oracle_steps(task: Task, trials: Sequence[Trial], num_envs: int = NUM_ENVS) -> Steps:
    """Returns the oracle's steps in each trial; None where it does not reach the goal."""
    # The oracle has the six actions and observes nothing; tracks have the lidar all the same.
    task = task.replace(actions="six", sensors=(), lidar_noise=None)
    agent = load_agent_class(ORACLE).build(task.interface)
    steps: list[int | None] = [None] * len(trials)
    for results in run_trials(agent, task, dict(enumerate(trials)), num_envs, needs_truth=True):
        stopping.check()
        for result in results:
            steps[result.number] = result.steps if result.success else None
    return tuple(steps)
