"""A pool that runs chunks: in this process, or in worker processes."""

from __future__ import annotations

import concurrent.futures
import concurrent.futures.process
import dataclasses
import errno
import functools
import multiprocessing
import multiprocessing.resource_tracker
import multiprocessing.synchronize
import os
import pickle
import signal
import sys
import threading
from collections.abc import Iterator, Sequence

from mazebench import stopping
from mazebench.agent import Agent
from mazebench.agent_loading import load_agent_class
from mazebench.errors import InputError, RunError, UnplayableError
from mazebench.evaluation.checked_agent import AgentError
from mazebench.evaluation.chunk import Chunk, Result, run_chunk
from mazebench.evaluation.plan import Plan

_PATIENCE = 0.5  # seconds to wait for a chunk to end before the caller may look for signals
_NO_GUARD = 86  # exit status of a worker whose script starts workers again
_LONGEST_STEP = 10.0  # seconds that a step may take until workers are ended that were asked to stop


class Pool:
    """Runs the chunks of all evaluations of a command; a context manager.

    It has worker processes, which start with the first chunk and are kept until the end. Without any, chunks run in
    this process.
    """

    def __init__(self, num_workers: int):
        self.num_workers = num_workers
        self._executor: concurrent.futures.Executor | None = None
        self._processes: set[multiprocessing.process.BaseProcess] = set()
        if not num_workers:
            return
        # A worker first runs the script that started it, which must not start workers of its own.
        if getattr(multiprocessing.current_process(), "_inheriting", False):
            os._exit(_NO_GUARD)
        main = sys.modules["__main__"]
        script = None if main.__spec__ else getattr(main, "__file__", None)
        if script is not None and not os.path.exists(script):  # as of standard input
            raise InputError(f"expected the script in a file, since each worker runs it first, found {script}")
        # Not forked: threads of the simulation may be running in this process.
        context = multiprocessing.get_context("spawn")
        self._stop = context.Event()
        self._executor = concurrent.futures.ProcessPoolExecutor(
            num_workers, context, initializer=_begin_worker, initargs=(self._stop,)
        )

    def run(self, plan: Plan, chunks: Sequence[Chunk]) -> Iterator[list[Result]]:
        """Yields the results of the episodes that ended, in any order; now and then none.

        Raises:
          InputError, RunError: what a chunk raised.
          RunError: if a worker ended abruptly.
        """
        if self._executor is None:
            for chunk in chunks:
                yield from run_chunk(plan, chunk)
            return

        # The class may have been made of a `SingleAgent`: a worker loads it by its name.
        packed = pickle.dumps(dataclasses.replace(plan, agent_class=Agent))
        # Workers start here. They inherit that SIGINT is blocked, and so leave Ctrl-C to this process. The tracker,
        # which would start with the first of them, undoes the mask.
        multiprocessing.resource_tracker.ensure_running()
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        before = set(multiprocessing.active_children())
        try:
            waiting = {self._executor.submit(_run_until_stopped, packed, chunk) for chunk in chunks}
        except OSError as error:
            way = "; raise the limit by `ulimit -n`, or use fewer" * (error.errno == errno.EMFILE)
            raise RunError(f"can't start {self.num_workers} worker processes: {error.strerror}{way}") from error
        finally:
            self._processes |= set(multiprocessing.active_children()) - before
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        while waiting:
            ended, waiting = concurrent.futures.wait(waiting, _PATIENCE, concurrent.futures.FIRST_COMPLETED)
            if stopping.is_asked():  # chunks that run end after their step
                self._stop.set()
                running = {future for future in waiting if not future.cancel()}
                ended |= concurrent.futures.wait(running, _LONGEST_STEP).done
            results: list[Result] = []
            fault: InputError | RunError | None = None
            for future in ended:
                try:
                    of_chunk, of_this = future.result()
                    results, fault = results + of_chunk, fault or of_this
                except concurrent.futures.process.BrokenProcessPool:
                    fault = self._broken()
            yield results
            if fault is not None:
                raise fault

    def _broken(self) -> InputError | RunError:
        """Returns the error of workers that ended abruptly."""
        assert self._executor is not None
        self._executor.shutdown()  # whose thread waits for the workers: a second one could be told no exit status
        if any(process.exitcode == _NO_GUARD for process in self._processes):
            return InputError(
                "expected the call with workers under `if __name__ == '__main__':`, since each worker runs the script "
                "first; found none"
            )
        return RunError("a worker process ended abruptly; what ended is kept, go on with --resume")

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, kind: object, *exception: object) -> None:
        if kind is not None:
            for process in self._processes:  # which may be in the middle of a chunk
                process.terminate()
        if self._executor is not None:
            self._executor.shutdown(cancel_futures=True)


_stop: multiprocessing.synchronize.Event  # of a worker's parent


@functools.lru_cache(maxsize=1)
def _unpacked(packed: bytes) -> Plan:
    """Returns the same plan for all chunks of an evaluation that a worker runs, so that they share the mazes."""
    plan = pickle.loads(packed)  # noqa: S301  # of the process that started this one
    return dataclasses.replace(plan, agent_class=load_agent_class(plan.options.agent))


def _run_until_stopped(packed: bytes, chunk: Chunk) -> tuple[list[Result], InputError | RunError | None]:
    """Returns the results of the episodes of a chunk, and what ended it before all of them had ended.

    Errors are of the plain kinds, since what caused them need not survive the way to another process. A chunk that is
    stopped ends without one after the step that runs.
    """
    ended: list[Result] = []
    try:
        for results in run_chunk(_unpacked(packed), chunk):
            ended += results
            if _stop.is_set():
                break
    except (InputError, RunError) as error:
        kinds = (UnplayableError, InputError, AgentError, RunError)
        return ended, next(kind for kind in kinds if isinstance(error, kind))(str(error))
    return ended, None


def _begin_worker(stop: multiprocessing.synchronize.Event) -> None:
    """Leaves this worker one core, and makes it end with its parent."""
    global _stop
    _stop = stop
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # PyTorch reads it when it is imported, our kernels when they run

    def end_with_parent() -> None:
        multiprocessing.parent_process().join()  # type: ignore[union-attr]  # a worker has one
        os._exit(1)

    threading.Thread(target=end_with_parent, daemon=True).start()
