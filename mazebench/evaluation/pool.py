"""Where chunks run: in this process, in worker processes, or on a Ray cluster."""

from __future__ import annotations

import concurrent.futures
import concurrent.futures.process
import contextlib
import multiprocessing
import multiprocessing.resource_tracker
import os
import signal
import threading
from collections.abc import Iterator, Sequence
from typing import Protocol

from mazebench import stopping
from mazebench.errors import RunError
from mazebench.evaluation.chunk import Chunk, Ended, run_chunk, run_whole_chunk
from mazebench.evaluation.options import RunOptions


class Pool(Protocol):
    """Runs chunks; used for all evaluations of a command."""

    num_workers: int  # chunks that run at a time in other processes; 0 for this process, which yields each step
    num_threads: int  # of a chunk's simulation; 0 for all cores

    def run(self, chunks: Sequence[Chunk]) -> Iterator[list[Ended]]:
        """Yields the episodes that ended, in any order.

        Raises:
          InputError, RunError: what a chunk raised.
          RunError: if a worker ended abruptly.
        """


@contextlib.contextmanager
def open_pool(run: RunOptions) -> Iterator[Pool]:
    """Yields the pool that is asked for and ends it.

    Raises:
      InputError: if there is no such cluster.
    """
    if run.cluster is not None:
        from mazebench.evaluation.cluster import Cluster  # Ray is an extra

        with Cluster(run.cluster, run.workers) as cluster:
            yield cluster
    elif run.workers:
        with _Processes(run.workers) as processes:
            yield processes
    else:
        yield _ThisProcess()


class _ThisProcess:
    num_workers = 0
    num_threads = 0

    def run(self, chunks: Sequence[Chunk]) -> Iterator[list[Ended]]:
        for chunk in chunks:
            yield from run_chunk(chunk)


class _Processes:
    """Worker processes, started with the first chunk and kept until the end."""

    num_threads = 1

    def __init__(self, workers: int):
        self.num_workers = workers
        # Not forked: threads of the simulation may be running in this process.
        context = multiprocessing.get_context("spawn")
        self._executor = concurrent.futures.ProcessPoolExecutor(workers, context, initializer=_begin_worker)
        self._processes: list[multiprocessing.process.BaseProcess] = []

    def run(self, chunks: Sequence[Chunk]) -> Iterator[list[Ended]]:
        before = multiprocessing.active_children()
        try:
            # Submitting starts the processes that are needed; stopped midway, they would end noisily. A signal that
            # this thread blocks may still arrive in one of NumPy's threads, and would then be handled here.
            with stopping.postponing(), _interrupts_blocked():
                futures = [self._executor.submit(run_whole_chunk, chunk) for chunk in chunks]
                self._processes += [child for child in multiprocessing.active_children() if child not in before]
            stopping.check()
        except OSError as error:
            raise RunError(f"can't start {self.num_workers} worker processes: {error.strerror}") from error
        try:
            for future in concurrent.futures.as_completed(futures):
                yield future.result()
        except concurrent.futures.process.BrokenProcessPool as error:
            raise RunError(f"{self._name_the_dead()}; go on with --resume") from error

    def _name_the_dead(self) -> str:
        self._executor.shutdown()  # ends the others by SIGTERM, and knows how each ended
        statuses = {process.pid: process.exitcode for process in self._processes if process.exitcode is not None}
        dead = {pid: status for pid, status in statuses.items() if status != -signal.SIGTERM} or statuses
        if not dead:
            return "a worker process ended abruptly"
        pid, status = next(iter(dead.items()))
        return f"worker process {pid} ended with exit status {status}"

    def __enter__(self) -> _Processes:
        return self

    def __exit__(self, kind: object, *exception: object) -> None:
        if kind is not None:
            for process in self._processes:  # which may be in the middle of a chunk
                process.terminate()
        self._executor.shutdown(cancel_futures=True)


@contextlib.contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Holds SIGINT back while worker processes start: they inherit that, and leave Ctrl-C to this process."""
    multiprocessing.resource_tracker.ensure_running()  # which would start with the first worker and undo the mask
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def _begin_worker() -> None:
    """Leaves this worker one core, and makes it end when its parent is killed and can't end it."""
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # PyTorch reads it when it is imported, our kernels when they run

    def wait() -> None:
        parent = multiprocessing.parent_process()
        assert parent is not None
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()
