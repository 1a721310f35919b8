"""Runs evaluations' episodes on a Ray cluster."""

from __future__ import annotations

import dataclasses
import signal
import sys
import threading
from collections.abc import Iterator
from typing import Any

from mazebench.errors import InputError, RunError
from mazebench.evaluation.workers import Ended, Job, run_job

try:
    import ray
except ModuleNotFoundError as error:
    raise InputError("--ray needs Ray, which the extra [ray] brings (docs/start.md)") from error

_MAX_LOST = 20  # of tasks in a run, before it gives up


class Cluster:
    """A connection to a Ray cluster; a context manager."""

    def __init__(self, address: str):
        """Connects to the cluster at `address`; "local" starts one on this machine, "auto" finds one that runs here.

        Raises:
          InputError: if there is none.
        """
        self._started = not ray.is_initialized()
        if self._started:
            connect(address)
        self.num_cpus = max(1, int(ray.cluster_resources().get("CPU", 0)))

    def run(self, jobs: Iterator[Job], num_envs: int, workers: int) -> Iterator[Ended]:
        """Runs the jobs as tasks of one CPU, `workers` at a time; what a lost task had left to do is given out again.

        Raises:
          InputError, RunError: what a job raised.
          RunError: if too many tasks were lost.
        """
        running: dict[Any, Job] = {}
        num_lost = 0
        while True:
            while len(running) < workers and (job := next(jobs, None)):
                running[_start(job, num_envs)] = job
            if not running:
                return
            task = ray.wait(list(running), num_returns=1)[0][0]
            job = running.pop(task)
            try:
                ended = _next_of(task)
            except ray.exceptions.RayError as error:
                num_lost += 1
                if num_lost > _MAX_LOST:
                    raise RunError(f"{num_lost} Ray tasks were lost, the last by: {_first_line(error)}") from error
                print("mazebench: a Ray task was lost; it is run again", file=sys.stderr)
                running[_start(job, num_envs)] = job
                continue
            if ended is not None:
                ran = {record["episode"] for record in ended.records}
                left = tuple(trial for trial in job.trials if trial[0] not in ran)
                running[task] = dataclasses.replace(job, trials=left)
                yield ended

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *exception: object) -> None:
        if self._started:
            ray.shutdown()


def connect(address: str | None) -> None:
    """Connects this process to the cluster at `address`, as `Cluster` does; None starts one, too.

    Raises:
      InputError: if there is none.
    """
    at_end, terminated = signal.getsignal(signal.SIGTERM), False
    try:
        ray.init(address=address, log_to_driver=False, include_dashboard=False)
    except SystemExit:  # Ray's answer to SIGTERM
        ray.shutdown()
        terminated = True
    except (ConnectionError, ValueError, RuntimeError) as error:
        said = " ".join(str(error).split())[:200]
        raise InputError(f"can't reach a Ray cluster at {address!r}: {said}") from error
    finally:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGTERM, at_end)  # which Ray takes
    if terminated:
        signal.raise_signal(signal.SIGTERM)


def _start(job: Job, num_envs: int) -> Any:
    """A task that gives what ended, step by step."""
    play = ray.remote(num_cpus=1, max_retries=0, num_returns="streaming")(_play)
    return play.remote(dataclasses.replace(job, task_spec=None), num_envs)


def _play(job: Job, num_envs: int) -> Iterator[Ended]:
    yield from run_job(job, num_envs, num_threads=1)


def _next_of(task: Any) -> Ended | None:
    """What ended next in a task, None where it is over; raises what the job raised, without Ray's account of it."""
    try:
        return ray.get(next(task))
    except StopIteration:
        return None
    except ray.exceptions.RayTaskError as error:
        cause = error.cause
        if isinstance(cause, (InputError, RunError)):
            raise cause from error
        raise RunError(f"a Ray task failed: {_first_line(cause)}") from error


def _first_line(error: object) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
