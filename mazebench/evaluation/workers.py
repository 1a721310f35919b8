"""Runs evaluations' episodes in this process or in several, which take jobs as they get free."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import multiprocessing
import multiprocessing.connection
import multiprocessing.resource_tracker
import os
import signal
import threading
import time
from collections.abc import Iterator
from typing import Any

from mazebench import stopping
from mazebench.agent import load_agent_class
from mazebench.errors import InputError, RunError
from mazebench.evaluation.contract import AgentError
from mazebench.evaluation.options import EvalOptions, build_agent, make_task_spec
from mazebench.evaluation.protocol import Trial
from mazebench.evaluation.runner import run_trials
from mazebench.evaluation.trajectories import Trajectory
from mazebench.records import Record
from mazebench.tasks.spec import TaskSpec

_POLL_SECONDS = 1.0  # between a worker's looks whether its parent is alive


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
    first = list(itertools.islice(jobs, workers))
    processes: dict[Any, Any] = {}  # by this end of the pipe to each
    try:
        try:
            with _undisturbed():
                processes |= (_start(num_envs) for _ in first)
        except OSError as error:
            raise RunError(
                f"can't start {len(first)} worker processes: {error.strerror}; go on with --resume"
            ) from error
        for pipe, job in zip(processes, first, strict=True):
            _send(pipe, job)
        running = set(processes)
        while running:
            for pipe in multiprocessing.connection.wait(running):
                result = _receive(pipe, processes[pipe])
                if isinstance(result, Exception):
                    raise result
                if isinstance(result, Ended):
                    yield result
                elif job := next(jobs, None):  # type: ignore[assignment]
                    _send(pipe, job)
                else:
                    running.remove(pipe)
    finally:
        for process in processes.values():
            process.terminate()
            process.join()


def _start(num_envs: int) -> tuple[Any, Any]:
    """This end of the pipe to a new worker, and its process."""
    # Not forked: threads of the simulation may be running in this process.
    context = multiprocessing.get_context("spawn")
    # A pipe each: a worker that is killed in the middle of a message ends its own, and would block one that all share.
    pipe, workers_end = context.Pipe()
    process = context.Process(target=_work, args=(workers_end, num_envs), daemon=True)
    process.start()
    workers_end.close()
    return pipe, process


@contextlib.contextmanager
def _undisturbed() -> Iterator[None]:
    """Lets signals to end wait until processes are started, which never get to see an interrupt.

    The terminal sends those to all processes; this one ends the others.
    """
    multiprocessing.resource_tracker.ensure_running()  # which would start with the first process, and undo the mask
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    came: list[int] = []
    # Handlers run in the main thread, whichever a signal is sent to.
    numbers = (signal.SIGINT, signal.SIGTERM) if threading.current_thread() is threading.main_thread() else ()
    try:
        with stopping.handling(numbers, lambda number, frame: came.append(number)):
            yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        for late in came:
            signal.raise_signal(late)


def _send(pipe: Any, job: Job) -> None:
    with contextlib.suppress(BrokenPipeError):  # which reading from it will tell
        pipe.send(dataclasses.replace(job, task_spec=None))


def _receive(pipe: Any, process: Any) -> Any:
    try:
        return pipe.recv()
    except (EOFError, OSError):  # OSError of a message that was cut off
        process.join()
        raise RunError(f"a worker ended with exit status {process.exitcode}; go on with --resume") from None


def _work(pipe: Any, num_envs: int) -> None:
    """Sends what ended, None after each job, and what a job raised."""
    threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()
    with contextlib.suppress(EOFError, ConnectionError):  # of a parent that is gone
        while True:
            job = pipe.recv()
            try:
                for ended in run_job(job, num_envs, num_threads=1):
                    pipe.send(ended)
            except (InputError, RunError) as error:
                # As plain text: what an error was caused by need not survive the way to another process.
                kinds = (InputError, AgentError, RunError)
                pipe.send(next(kind for kind in kinds if isinstance(error, kind))(str(error)))
                return
            pipe.send(None)


def _end_with(parent: int) -> None:
    """Ends this process when its parent is gone: one that was killed could not end its workers."""
    while os.getppid() == parent:
        time.sleep(_POLL_SECONDS)
    os._exit(1)
