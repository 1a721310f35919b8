"""The steps of `oracle` in the episodes of an evaluation, measured where they are not frozen."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Iterator, Sequence

from mazebench import stopping
from mazebench.agent_loading import load_agent_class
from mazebench.evaluation.chunk import Keep, Result, run_trials
from mazebench.evaluation.eval_options import NUM_ENVS
from mazebench.evaluation.plan import Plan
from mazebench.results.records import Record
from mazebench.tasks.sensors import WITHOUT_SENSORS
from mazebench.tasks.task import Task
from mazebench.tasks.trials import Trial

_ORACLE = "oracle"


def with_oracle_steps(
    plan: Plan,
    records: Sequence[Record],
    num_envs: int,
    progress: Callable[[int, int], None] = lambda ended, of: None,
) -> list[Record]:
    """Returns the records of a plan's episodes, all legs of each, with the oracle's steps.

    Those of a leg after a missed goal are of a drive of its own, which begins at rest in the middle of the leg's start.
    `progress` is called as the oracle's drives end, with their number and that of all.
    """
    trials = [plan.trials[number] for number in dict.fromkeys(record.episode for record in records)]
    if all(leg.oracle_steps is not None for trial in trials for leg in trial.legs):
        steps = [record.oracle_steps for record in records]
    elif plan.options.agent == _ORACLE:
        steps = [record.steps if record.success else None for record in records]
    else:
        steps = list(itertools.chain.from_iterable(measure_steps_of_legs(plan.task, trials, num_envs, progress)))

    if missed := [number for number, record in enumerate(records) if record.after_missed_goal]:
        drives = []
        for record in (records[number] for number in missed):
            episode = dataclasses.replace(plan.trials[record.episode].episode, start=record.start, goal=record.goal)
            drives.append(Trial(episode, record.distance, record.shortest_path))
        alone = measure_oracle_steps(plan.task.replace(num_goals=1), drives, num_envs)
        for number, each in zip(missed, alone, strict=True):
            steps[number] = each
    return [record.model_copy(update={"oracle_steps": each}) for record, each in zip(records, steps, strict=True)]


def measure_oracle_steps(task: Task, trials: Sequence[Trial], num_envs: int = NUM_ENVS) -> list[int | None]:
    """Returns the oracle's steps to the first goal of each trial; None where it does not reach it."""
    return [steps for steps, *_ in measure_steps_of_legs(task, trials, num_envs)]


def measure_steps_of_legs(
    task: Task,
    trials: Sequence[Trial],
    num_envs: int = NUM_ENVS,
    progress: Callable[[int, int], None] = lambda ended, of: None,
) -> list[list[int | None]]:
    """Returns the oracle's steps to each goal of each trial, in one drive; None where it does not reach the goal."""
    steps: list[list[int | None]] = [[] for _ in trials]
    progress(0, len(steps))
    for results in oracle_drives(task, trials, num_envs):
        stopping.check()
        for result in results:
            is_measured = result.success and result.after_miss is None
            steps[result.number].append(result.steps if is_measured else None)
        if results:
            progress(sum(map(bool, steps)), len(steps))
    return steps


def oracle_drives(
    task: Task, trials: Sequence[Trial], num_envs: int = NUM_ENVS, keep: Keep | None = None
) -> Iterator[list[Result]]:
    """Yields the results of the oracle in some trials, as `run_trials` does."""
    # The oracle has the six actions and observes nothing; tracks have the lidar all the same.
    task = task.replace(actions="six", **WITHOUT_SENSORS)
    agent = load_agent_class(_ORACLE).build(task.interface)
    return run_trials(agent, task, dict(enumerate(trials)), num_envs, needs_truth=True, keep=keep)
