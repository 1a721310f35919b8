"""Evaluations from options to a summary: `make_plan`, `Pool.run`, `Store.append`, `summarize`, `Store.finish`."""

from __future__ import annotations

import math
import pathlib
import tempfile
from collections.abc import Callable
from typing import Any

from mazebench import stopping
from mazebench.agent import Agent, SingleAgent
from mazebench.agent_loading import checked_agent_class, load_agent_class
from mazebench.errors import InputError, remark
from mazebench.evaluation.chunk import Chunk
from mazebench.evaluation.eval_options import EvalOptions, RunOptions, eval_options
from mazebench.evaluation.measured_oracle import with_oracle_steps
from mazebench.evaluation.plan import Plan, make_plan
from mazebench.evaluation.pool import Pool
from mazebench.evaluation.store import Store, check_same_run, is_finished
from mazebench.options import check_names, options_in
from mazebench.results import metrics
from mazebench.results.reading import load_result
from mazebench.results.records import PairFigures, Summary, counts_in
from mazebench.storage.files import locked
from mazebench.tasks.task import Task
from mazebench.tasks.task_options import TaskOptions

_CHUNKS_PER_WORKER = 4  # so that no worker waits long for the last one,
_LEAST_CHUNK = 64  # but not so many that their environments are few: agents act on all of them at once
_EPISODES_PER_ENV = 4  # at least, in a worker's chunk: environments that have ended an episode take another

# Called with the number of episodes that have ended and of all.
Progress = Callable[[int, int], None]


def evaluate(
    agent: str | type[Agent] | type[SingleAgent],
    task: str | Task | TaskOptions = "local",
    out: str | pathlib.Path | None = None,
    *,
    progress: Progress = lambda ended, of: None,
    **options: Any,
) -> Summary:
    """Evaluates an agent in a task and returns the summary.

        >>> mazebench.evaluate("planner", "building", level=2).overall.success_rate

    A `mazebench.errors.Remark` warns of what a user should know, such as maps of a scale on which the agent did not
    learn.

    Args:
      agent: the name of an installed agent, "module:Class", or a class.
      task: "local", "hierarchical" or the name of a track, by default in eval mazes and at distances of 1 to 15; or a
        `Task`, which is played as it is.
      out: the folder for records, summary and options; None keeps the summary alone.
      progress: called as episodes end, with their number and that of all.
      **options: by name, as docs/options.md and docs/evaluate.md list them: those of the evaluation (`EvalOptions`:
        episodes_per_distance, checkpoint, seed, overrides, ...), of its run (`RunOptions`: resume, record, num_envs,
        workers), and those of `Task.of`, unless `task` is a `Task`.

    Raises:
      InputError: if an option can't be met, or `out` can't be written or holds another run.
      RunError: if the agent or a worker failed; what ended until then is kept.
    """
    check_names(options, EvalOptions, RunOptions, TaskOptions)
    out = None if out is None else pathlib.Path(out).absolute()  # agents may change the working folder
    if options.get("context_size") is not None:
        raise InputError(
            f"expected no context_size in an evaluation, found {options['context_size']}; agents choose it"
        )
    run = RunOptions.of(of_run := options_in(options, RunOptions))
    if not isinstance(agent, str | type):
        raise InputError(f"expected the name of an agent or its class, found an object of {type(agent).__name__}")
    name = agent if isinstance(agent, str) else f"{agent.__module__}:{agent.__qualname__}"
    agent_class = load_agent_class(name) if isinstance(agent, str) else checked_agent_class(name, agent)
    chosen = eval_options(name, task, **{key: value for key, value in options.items() if key not in of_run})
    if run.workers and (name.startswith("__main__:") or load_agent_class(name) is not agent_class):
        raise InputError(f"expected a class that other processes can import by its name, found {name}")
    return run_evaluation(chosen, out, run, progress, agent_class, task if isinstance(task, Task) else None)


def run_evaluation(
    options: EvalOptions,
    out: str | pathlib.Path | None,
    run: RunOptions,
    progress: Progress = lambda ended, of: None,
    agent_class: type[Agent] | None = None,
    task: Task | None = None,
    summing: Progress = lambda ended, of: None,
) -> Summary:
    """Runs what is left of an evaluation and returns its summary; as `evaluate`, which makes the options.

    `agent_class` is the class that `options.agent` names, and `task` has the options `options.task`, if they are there
    already. `summing` is called as the oracle's drives end, which are measured after the last episode.
    """
    out = None if out is None else pathlib.Path(out).absolute()
    plan = make_plan(options, agent_class, task=task)
    plan.check_workers(run.workers)
    plan.say_remarks()
    if plan.provenance.agent_code_sha256 is None:
        remark(
            f"{options.agent}: its code is in no file, so it has no hash, and --resume does not notice a change of it"
        )
    with Pool(run.workers) as pool, tempfile.TemporaryDirectory() as temporary:
        return run_plan(plan, out or pathlib.Path(temporary), pool, run, progress, summing)


def run_plan(
    plan: Plan,
    folder: pathlib.Path,
    pool: Pool,
    run: RunOptions,
    progress: Progress = lambda ended, of: None,
    summing: Progress = lambda ended, of: None,
    *,
    suite: str | None = None,
    part: str | None = None,
) -> Summary:
    """Runs what is left of a plan in `folder` and returns its summary; a finished run is not run again."""
    num_trials, record = len(plan.trials), bool(run.record)
    if run.resume and is_finished(folder, record):
        check_same_run(folder, plan.identity)
        summary = load_result(folder).summary
        progress(num_trials, num_trials)
        return summary
    with locked(folder, "evaluation"), Store(folder, plan, resume=run.resume, record=record) as store:
        progress(store.num_ended, num_trials)
        for results in pool.run(plan, _cut(store, pool, run.num_envs)):
            if results:
                store.append(results)
                progress(store.num_ended, num_trials)
            stopping.check()
        records = with_oracle_steps(plan, store.records, run.num_envs, summing)
        summary = Summary(
            agent=plan.options.agent,
            task=plan.task.options,
            privileged=plan.agent_class.needs_truth,
            untrained_scale=plan.untrained_scale,
            config=plan.chosen_config,
            suite=suite,
            part=part,
            benchmark=plan.task.options.benchmark,
            episodes=num_trials,
            provenance=plan.provenance,
            **metrics.summarize(records),
            pairs={
                older.maze.name: PairFigures(covered=older.pair.covered, pose=older.pair.pose, **older.pair.areas)
                for older in plan.task.arena.shown or ()
                if older.pair is not None
            },
            counts=counts_in(records),
        )
        store.finish(records, summary)
    return summary


def _cut(store: Store, pool: Pool, num_envs: int) -> list[Chunk]:
    """Returns what is left to run as chunks of one size and mixture."""
    missing = store.missing
    num_chunks = min(1, len(missing))
    if pool.num_workers and missing:
        wanted = min(_CHUNKS_PER_WORKER * pool.num_workers, len(missing) // _LEAST_CHUNK)
        num_chunks = min(len(missing), max(pool.num_workers, wanted))
        num_envs = min(num_envs, math.ceil(len(missing) / num_chunks / _EPISODES_PER_ENV))
    num_threads = 1 if pool.num_workers else 0
    return [
        Chunk(missing[first::num_chunks], num_envs, num_threads, store.record, store.folder)
        for first in range(num_chunks)
    ]
