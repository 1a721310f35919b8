"""Runs evaluations' episodes in this process or in several, which take jobs as they get free."""

from __future__ import annotations

import dataclasses
import itertools
import multiprocessing
import os
import queue
import signal
import threading
import time
from collections.abc import Iterator
from typing import Any

from mazebench.agent import load_agent_class
from mazebench.errors import InputError, RunError
from mazebench.evaluation.options import EvalOptions, build_agent, make_task_spec
from mazebench.evaluation.protocol import Trial
from mazebench.evaluation.runner import run_trials
from mazebench.evaluation.trajectories import Trajectory
from mazebench.records import Record
from mazebench.tasks.spec import TaskSpec

_POLL_SECONDS = 1.0  # between looks whether all workers are alive


@dataclasses.dataclass(frozen=True)
class Job:
    """Episodes of one evaluation for one process to run."""

    number: int  # of the evaluation, among those that run together
    options: EvalOptions
    trials: tuple[tuple[int, Trial], ...]  # with their indices
    record: bool  # whether trajectories are wanted
    task_spec: TaskSpec | None = None  # None where another process makes it anew from the options


@dataclasses.dataclass(frozen=True)
class Ended:
    """Episodes of one evaluation that ended."""

    number: int
    records: list[Record]
    trajectories: dict[int, Trajectory]  # by the episode's index; empty where none are wanted


def run_job(job: Job, num_envs: int, num_threads: int) -> Iterator[Ended]:
    """Runs a job in this process and yields what ended, step by step."""
    agent_class = load_agent_class(job.options.agent)
    task_spec = job.task_spec or make_task_spec(job.options, agent_class)
    agent = build_agent(job.options, agent_class, task_spec)
    waiting: dict[int, Trajectory] = {}
    remember = waiting.__setitem__ if job.record else None
    for records in run_trials(agent, task_spec, job.trials, num_envs, num_threads, remember):
        yield Ended(job.number, records, dict(waiting))
        waiting.clear()


def run_here(jobs: Iterator[Job], num_envs: int) -> Iterator[Ended]:
    """Runs the jobs one after the other, each on all cores."""
    for job in jobs:
        yield from run_job(job, num_envs, num_threads=0)


def run_in_processes(jobs: Iterator[Job], num_envs: int, workers: int) -> Iterator[Ended]:
    """Runs the jobs in up to `workers` processes; `jobs` is asked for the next one when a process is free.

    Raises:
      InputError, RunError: what a job raised.
      RunError: if a process ended otherwise.
    """
    # Not forked: threads of the simulation may be running in this process.
    context = multiprocessing.get_context("spawn")
    tasks, results = context.Queue(), context.Queue()
    first = list(itertools.islice(jobs, workers))
    processes = [context.Process(target=_work, args=(tasks, results, num_envs), daemon=True) for _ in first]
    for process in processes:
        process.start()
    try:
        for job in first:
            tasks.put(dataclasses.replace(job, task_spec=None))
        num_running = len(first)
        while num_running:
            result = _next_result(results, processes)
            if isinstance(result, Exception):
                raise result
            if isinstance(result, Ended):
                yield result
                continue
            job = next(jobs, None)  # type: ignore[assignment]
            tasks.put(job and dataclasses.replace(job, task_spec=None))
            num_running -= job is None
    finally:
        for process in processes:
            process.terminate()
            process.join()


def _next_result(results: Any, processes: list[Any]) -> Any:
    while True:
        try:
            return results.get(timeout=_POLL_SECONDS)
        except queue.Empty:
            dead = [process.exitcode for process in processes if process.exitcode]
            if dead:
                raise RunError(f"a worker ended with exit status {dead[0]}; go on with --resume") from None


def _work(tasks: Any, results: Any, num_envs: int) -> None:
    """Puts what ended into `results`, None after each job, and what a job raised."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt reaches all processes; the parent ends this one
    threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()
    while (job := tasks.get()) is not None:
        try:
            for ended in run_job(job, num_envs, num_threads=1):
                results.put(ended)
        except (InputError, RunError) as error:
            # As plain text: what an error was caused by need not survive the way to another process.
            results.put(InputError(str(error)) if isinstance(error, InputError) else RunError(str(error)))
            return
        results.put(None)


def _end_with(parent: int) -> None:
    """Ends this process when its parent is gone: one that was killed could not end its workers."""
    while os.getppid() == parent:
        time.sleep(_POLL_SECONDS)
    os._exit(1)
