"""A pool that runs chunks: in this process, in worker processes, or wherever an executor runs them."""

from __future__ import annotations

import concurrent.futures
import concurrent.futures.process
import contextlib
import dataclasses
import errno
import functools
import itertools
import multiprocessing
import multiprocessing.resource_tracker
import multiprocessing.synchronize
import os
import pickle
import signal
import sys
import threading
import warnings
from collections.abc import Iterable, Iterator
from typing import Any

from mazebench import stopping
from mazebench.agent import Agent
from mazebench.agent_loading import load_agent_class
from mazebench.errors import InputError, Remark, RunError, UnplayableError, describe_error
from mazebench.evaluation.checked_agent import AgentError
from mazebench.evaluation.chunk import Chunk, Result, run_chunk
from mazebench.evaluation.eval_options import RunOptions
from mazebench.evaluation.nodes import check_node, common_of
from mazebench.evaluation.plan import Plan

PATIENCE = 0.5  # seconds to wait for a chunk to end before the caller may look for signals
_NO_GUARD = 86  # exit status of a worker whose script starts workers again
_LONGEST_STEP = 10.0  # seconds that a step may take until workers are ended that were asked to stop


_CHUNKS_AHEAD = 2  # for each worker, of which it runs one: the next evaluation begins while the last chunks end


@contextlib.contextmanager
def pool_of(run: RunOptions, executor: concurrent.futures.Executor | None = None) -> Iterator[Pool]:
    """Yields the pool that a run asks for: of its cluster, of an executor, or of its workers.

    Raises:
      InputError: if the cluster can't be reached, or the number of an executor's workers is not given.
    """
    with contextlib.ExitStack() as stack:
        workers = run.workers
        if run.cluster is not None:
            from mazebench.evaluation.ray_cluster import RayExecutor

            executor = cluster = stack.enter_context(RayExecutor(run.cluster))
            workers = workers or cluster.num_cores
        if executor is not None and not workers:
            raise InputError("expected workers with an executor, the number of chunks that it runs at once, found 0")
        yield stack.enter_context(Pool(workers, executor))


class Pool:
    """Runs the chunks of all evaluations of a command; a context manager.

    It has worker processes, which start with the first chunk and are kept until the end. With an executor, which may
    run them on other machines, it has none. Without either, chunks run in this process.
    """

    def __init__(self, num_workers: int, executor: concurrent.futures.Executor | None = None):
        self.num_workers, self.is_external = num_workers, executor is not None
        self._executor = executor
        self._processes: set[multiprocessing.process.BaseProcess] = set()
        if executor is not None or not num_workers:
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

    def run(self, work: Iterable[tuple[Any, Plan, Chunk]]) -> Iterator[dict[Any, list[Result]]]:
        """Yields the results of the episodes that ended, in any order, by the keys of `work`; now and then none.

        The next items of `work`, each a key, a plan and a chunk of it, are asked for while the last ones run.

        Raises:
          InputError, RunError: what a chunk raised.
          RunError: if a worker ended abruptly.
        """
        if self._executor is None:
            for key, plan, chunk in work:
                for of_step in run_chunk(plan, chunk):
                    yield {key: of_step}
            return

        items, waiting = iter(work), dict[concurrent.futures.Future[_Ended], Any]()
        try:
            while True:
                room = max(0, _CHUNKS_AHEAD * self.num_workers - len(waiting))
                for key, plan, chunk in itertools.islice(items, room):
                    waiting[self._submit(plan, chunk)] = key
                if not waiting:
                    return
                ended = concurrent.futures.wait(waiting, PATIENCE, concurrent.futures.FIRST_COMPLETED).done
                if stopping.is_asked() and not self.is_external:  # chunks that run end after their step
                    self._stop.set()
                    running = {future for future in waiting if not future.cancel()}
                    ended = concurrent.futures.wait(running, _LONGEST_STEP).done
                results = dict[Any, list[Result]]()
                fault: InputError | RunError | None = None
                for future in ended:
                    key = waiting.pop(future)
                    try:
                        of_chunk, of_this = self._ended(future)
                        results[key], fault = results.get(key, []) + of_chunk, fault or of_this
                    except (InputError, RunError) as error:
                        fault = error
                yield results
                if fault is not None:
                    raise fault
        finally:
            for future in waiting:
                future.cancel()

    def _submit(self, plan: Plan, chunk: Chunk) -> concurrent.futures.Future[_Ended]:
        assert self._executor is not None
        packed = _packed(plan, self.is_external)
        if not self.is_external:  # whose workers start here; the tracker, which starts with the first, undoes the mask
            multiprocessing.resource_tracker.ensure_running()
        mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # inherited: workers leave Ctrl-C to this one
        before = set(multiprocessing.active_children())
        try:
            return self._executor.submit(_run_until_stopped, packed, chunk)
        except concurrent.futures.BrokenExecutor as error:  # since a worker ended, as the chunks before will tell
            future = concurrent.futures.Future[_Ended]()
            future.set_exception(error)
            return future
        except OSError as error:
            way = "; raise the limit by `ulimit -n`, or use fewer" * (error.errno == errno.EMFILE)
            raise RunError(f"can't start {self.num_workers} worker processes: {error.strerror}{way}") from error
        finally:
            if not self.is_external:
                self._processes |= set(multiprocessing.active_children()) - before
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)

    def _ended(self, future: concurrent.futures.Future[_Ended]) -> _Ended:
        """Returns what a chunk returned; raises an error in one line where its worker is lost."""
        try:
            return future.result()
        except concurrent.futures.process.BrokenProcessPool as error:
            raise self._broken() from error
        except Exception as error:  # of an engine
            if not self.is_external:
                raise
            found = describe_error(error).partition("\n")[0]
            raise RunError(f"the executor lost a chunk: {found}; what ended is kept, go on with --resume") from error

    def _broken(self) -> InputError | RunError:
        """Returns the error of workers that ended abruptly."""
        assert self._executor is not None
        if not self.is_external:
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
        if self._executor is not None and not self.is_external:
            self._executor.shutdown(cancel_futures=True)


_stop: multiprocessing.synchronize.Event | None = None  # of a worker's parent
_Ended = tuple[list[Result], InputError | RunError | None]  # of a chunk, and what ended it


@functools.lru_cache(maxsize=1)
def _packed(plan: Plan, is_external: bool) -> bytes:
    """Returns a plan for other processes and, if they may be on other machines, what these must have in common."""
    # The class may have been made of a `SingleAgent`: a worker loads it by its name.
    common = common_of(plan.options.agent, plan.agent_class, plan.options.checkpoint) if is_external else None
    return pickle.dumps((dataclasses.replace(plan, agent_class=Agent), common))


@functools.lru_cache(maxsize=1)
def _unpacked(packed: bytes) -> Plan:
    """Returns the same plan for all chunks of an evaluation that a worker runs, so that they share the mazes."""
    plan, common = pickle.loads(packed)  # noqa: S301  # of the process that started this one
    options = plan.options if common is None else dataclasses.replace(plan.options, checkpoint=check_node(common))
    return dataclasses.replace(plan, options=options, agent_class=load_agent_class(options.agent))


def _run_until_stopped(packed: bytes, chunk: Chunk) -> _Ended:
    """Returns the results of the episodes of a chunk, and what ended it before all of them had ended.

    A chunk that is stopped ends without an error after the step that runs.
    """
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # PyTorch reads it when it is imported, our kernels when they run
    ended: list[Result] = []
    try:
        for results in run_chunk(_unpacked(packed), chunk):
            ended += results
            if _stop is not None and _stop.is_set():
                break
    except (InputError, RunError) as error:
        return ended, plain(error)
    return ended, None


def plain(error: InputError | RunError) -> InputError | RunError:
    """Returns an error of a plain kind, since what caused it need not survive the way to another process."""
    kinds = (UnplayableError, InputError, AgentError, RunError)
    return next(kind for kind in kinds if isinstance(error, kind))(str(error))


def _begin_worker(stop: multiprocessing.synchronize.Event) -> None:
    """Makes a worker end with its parent, and leaves remarks to it."""
    global _stop
    _stop = stop
    warnings.simplefilter("ignore", Remark)

    def end_with_parent() -> None:
        multiprocessing.parent_process().join()  # type: ignore[union-attr]  # a worker has one
        os._exit(1)

    threading.Thread(target=end_with_parent, daemon=True).start()
