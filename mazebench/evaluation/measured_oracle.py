"""The steps of `oracle` in the episodes of an evaluation, measured where they are not frozen."""

from __future__ import annotations

from collections.abc import Sequence

from mazebench import stopping
from mazebench.agent_loading import load_agent_class
from mazebench.evaluation.chunk import run_trials
from mazebench.evaluation.eval_options import NUM_ENVS
from mazebench.evaluation.plan import Plan
from mazebench.results.records import Record
from mazebench.tasks.task import Task
from mazebench.tasks.trials import Trial

_ORACLE = "oracle"


def with_oracle_steps(plan: Plan, records: Sequence[Record], num_envs: int) -> list[Record]:
    """Returns the records of all of a plan's episodes with the oracle's steps."""
    if all(trial.oracle_steps is not None for trial in plan.trials):
        return list(records)
    if plan.options.agent == _ORACLE:
        steps = [record.steps if record.success else None for record in records]
    else:
        steps = measure_oracle_steps(plan.task, plan.trials, num_envs)
    return [record.model_copy(update={"oracle_steps": each}) for record, each in zip(records, steps, strict=True)]


def measure_oracle_steps(task: Task, trials: Sequence[Trial], num_envs: int = NUM_ENVS) -> list[int | None]:
    """Returns the oracle's steps in each trial; None where it does not reach the goal."""
    # The oracle has the six actions and observes nothing; tracks have the lidar all the same.
    task = task.replace(actions="six", sensors=(), lidar_noise=None)
    agent = load_agent_class(_ORACLE).build(task.interface)
    steps: list[int | None] = [None] * len(trials)
    for results in run_trials(agent, task, dict(enumerate(trials)), num_envs, needs_truth=True):
        stopping.check()
        for result in results:
            steps[result.number] = result.steps if result.success else None
    return steps
