"""Evaluations from options to a summary: `make_plan`, `Pool.run`, `Store.append`, `summarize`, `Store.finish`."""

from __future__ import annotations

import concurrent.futures
import contextlib
import dataclasses
import math
import pathlib
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

from mazebench import stopping
from mazebench.agent import Agent, SingleAgent
from mazebench.agent_loading import checked_agent_class, load_agent_class
from mazebench.errors import InputError, remark
from mazebench.evaluation.chunk import Chunk, Keep, poses_of
from mazebench.evaluation.eval_options import MOST_RECORDED, WHOLE, EvalOptions, RunOptions, Shard, eval_options
from mazebench.evaluation.measured_oracle import with_oracle_steps
from mazebench.evaluation.plan import Plan, make_plan
from mazebench.evaluation.pool import Pool, pool_of
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
_LEAST_ELSEWHERE = 4  # episodes in a chunk of an executor: chunks of one cost networks three times the CPU

# Called with the number of episodes that have ended and of all.
Progress = Callable[[int, int], None]


def evaluate(
    agent: str | type[Agent] | type[SingleAgent],
    task: str | Task | TaskOptions = "local",
    out: str | pathlib.Path | None = None,
    *,
    progress: Progress = lambda ended, of: None,
    executor: concurrent.futures.Executor | None = None,
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
      executor: runs the episodes, perhaps on other machines, with the option `workers` as the number of chunks at once.
        It is not shut down. Its processes must be able to import mazebench and the agent.
      **options: by name, as docs/options.md and docs/evaluate.md list them: those of the evaluation (`EvalOptions`:
        episodes_per_distance, checkpoint, seed, overrides, ...), of its run (`RunOptions`: resume, record, num_envs,
        workers, cluster), and those of `Task.of`, unless `task` is a `Task`.

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
    spreads = run.workers or run.cluster or executor
    if spreads and (name.startswith("__main__:") or load_agent_class(name) is not agent_class):
        raise InputError(f"expected a class that other processes can import by its name, found {name}")
    found = task if isinstance(task, Task) else None
    summary = run_evaluation(chosen, out, run, progress, agent_class, found, executor)
    assert summary is not None
    return summary


def run_evaluation(
    options: EvalOptions,
    out: str | pathlib.Path | None,
    run: RunOptions,
    progress: Progress = lambda ended, of: None,
    agent_class: type[Agent] | None = None,
    task: Task | None = None,
    executor: concurrent.futures.Executor | None = None,
    shard: Shard = WHOLE,
    summing: Progress = lambda ended, of: None,
    is_dry: bool = False,
    pool: Pool | None = None,
) -> Summary | None:
    """Runs what is left of an evaluation and returns its summary; as `evaluate`, which makes the options.

    `agent_class` is the class that `options.agent` names, and `task` has the options `options.task`, if they are there
    already. Of a `shard` without episodes, None is returned. `summing` is called as the oracle's drives end, which are
    measured after the last episode. If `is_dry`, it says what the evaluation may cost and runs nothing. `pool` runs
    the episodes instead of the one that `run` asks for.
    """
    out = None if out is None else pathlib.Path(out).absolute()
    plan = make_plan(options, agent_class, task=task)
    plan.check_spread(run.workers, machines=run.cluster is not None or executor is not None or shard != WHOLE)
    plan.say_remarks()
    if plan.provenance.agent_code_sha256 is None:
        remark(
            f"{options.agent}: its code is in no file, so it has no hash, and --resume does not notice a change of it"
        )
    episodes = shard.numbers(plan.trials)
    say_cost([(plan, len(episodes))], is_dry)
    if is_dry:
        return None
    with pool_of(run, executor, pool) as pool, tempfile.TemporaryDirectory() as temporary:
        # Nobody reads the paths of a folder that is gone, and those of many episodes take room.
        record = run.record if out and len(plan.trials) <= MOST_RECORDED else bool(run.record)
        job = Job(plan, out or pathlib.Path(temporary), record, episodes)
        summaries = run_jobs([job], 1, len(episodes), pool, run, progress, summing)
    return summaries[0] if summaries else None


def say_cost(plans: Iterable[tuple[Plan, int]], is_dry: bool) -> None:
    """Says for each agent of some plans what so many episodes may cost; if `is_dry`, also that they are free."""
    of_agents: dict[str, tuple[Plan, int]] = {}
    for plan, episodes in plans:
        first, before = of_agents.get(plan.options.agent, (plan, 0))
        of_agents[plan.options.agent] = first, before + episodes
    for name, (plan, episodes) in of_agents.items():
        line = plan.config.cost(episodes, plan.task.size)
        if line or is_dry:
            remark(f"{name}: {line or f'{episodes:,} episodes, which cost nothing'}")


@dataclasses.dataclass(frozen=True, eq=False)
class Job:
    """An evaluation to run in a folder, or some of its episodes."""

    plan: Plan
    folder: pathlib.Path
    record: bool | None  # None: yes, unless it has begun without
    episodes: Sequence[int]  # by number; without any, nothing is written
    suite: str | None = None
    part: str | None = None


class _Running(NamedTuple):
    """A job that has begun."""

    job: Job
    store: Store
    left: set[int]  # the episodes that have not ended
    closing: contextlib.ExitStack  # of the store


def run_jobs(
    jobs: Iterable[Job],
    num_jobs: int,
    num_episodes: int,
    pool: Pool,
    run: RunOptions,
    progress: Progress,
    summing: Progress,
) -> list[Summary]:
    """Runs what is left of some evaluations and returns their summaries in order; a finished one is not run again.

    The next one is asked for, and begins, when the pool has room. `num_jobs` and `num_episodes` are those of all.
    """
    summaries: dict[int, Summary] = {}
    running: dict[int, _Running] = {}
    num_ended = 0

    def advance(by: int) -> None:
        nonlocal num_ended
        num_ended += by
        progress(num_ended, num_episodes)

    def end_if_whole(index: int) -> None:
        if index in running and not running[index].left:
            job, store, _, closing = running.pop(index)
            with closing:
                summaries[index] = _finish(job, store, run.num_envs, summing)

    def work(opened: contextlib.ExitStack) -> Iterator[tuple[int, Plan, Chunk]]:
        for index, job in enumerate(jobs):
            if run.resume and is_finished(job.folder, bool(job.record)):
                check_same_run(job.folder, job.plan.identity)
                summaries[index] = load_result(job.folder).summary
                advance(len(job.episodes))
            elif job.episodes:
                closing = opened.enter_context(contextlib.ExitStack())
                closing.enter_context(locked(job.folder, "evaluation"))
                store = closing.enter_context(Store(job.folder, job.plan, resume=run.resume, record=job.record))
                left = set(job.episodes).intersection(store.missing)
                running[index] = _Running(job, store, left, closing)
                advance(len(job.episodes) - len(left))
                keep = poses_of if store.record else None
                for chunk in cut(sorted(left), pool, run.num_envs, num_jobs, keep=keep, folder=store.folder):
                    yield index, job.plan, chunk
                end_if_whole(index)

    with contextlib.ExitStack() as opened:
        for ended in pool.run(work(opened)):
            for index, results in ended.items():
                if results:
                    numbers = {result.number for result in results}
                    running[index].store.append(results)
                    running[index].left.difference_update(numbers)
                    advance(len(numbers))
            stopping.check()
            for index in ended:
                end_if_whole(index)
    return [summaries[index] for index in sorted(summaries)]


def _finish(job: Job, store: Store, num_envs: int, summing: Progress) -> Summary:
    """Writes the results of an evaluation of which all episodes have ended, and returns the summary."""
    plan, records = job.plan, with_oracle_steps(job.plan, store.records, num_envs, summing)
    summary = Summary(
        agent=plan.options.agent,
        task=plan.task.options,
        privileged=plan.agent_class.needs_truth,
        untrained_scale=plan.untrained_scale,
        config=plan.chosen_config,
        suite=job.suite,
        part=job.part,
        benchmark=plan.task.options.benchmark,
        episodes=len(job.episodes),
        provenance=plan.provenance,
        **metrics.summarize(records),
        pairs={
            older.maze.name: PairFigures(covered=older.pair.covered, pose=older.pair.pose, **older.pair.areas)
            for older in plan.task.arena.shown or ()
            if older.pair is not None
        },
        counts={**(counts := counts_in(records)), **plan.config.sums(counts)},
    )
    store.finish(records, summary)
    return summary


def cut(
    numbers: Sequence[int],
    pool: Pool,
    num_envs: int,
    num_evaluations: int = 1,
    *,
    keep: Keep | None = None,
    folder: pathlib.Path | None = None,
) -> list[Chunk]:
    """Returns episodes of an evaluation as chunks of one size and mixture.

    An executor takes whole evaluations where there are enough of them.
    """
    num_chunks = min(1, len(numbers))
    if pool.num_workers and numbers:
        evaluations, least, per_env = (
            (num_evaluations, _LEAST_ELSEWHERE, 1) if pool.is_external else (1, 1, _EPISODES_PER_ENV)
        )
        wanted = min(math.ceil(_CHUNKS_PER_WORKER * pool.num_workers / evaluations), len(numbers) // _LEAST_CHUNK)
        num_chunks = max(1, min(len(numbers) // least, max(math.ceil(pool.num_workers / evaluations), wanted)))
        num_envs = min(num_envs, math.ceil(len(numbers) / num_chunks / per_env))
    num_threads = 1 if pool.num_workers else 0
    return [Chunk(numbers[first::num_chunks], num_envs, num_threads, keep, folder) for first in range(num_chunks)]
