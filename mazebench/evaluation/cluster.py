"""Runs chunks as tasks of a Ray cluster."""

from __future__ import annotations

import signal
import socket
import threading
import urllib.parse
from collections.abc import Iterator, Sequence
from typing import Any

from mazebench.errors import InputError, RunError, shortened
from mazebench.evaluation.chunk import Chunk, Ended, run_whole_chunk

try:
    import ray
except ModuleNotFoundError as error:
    raise InputError("--ray needs Ray, which the extra [ray] brings (docs/start.md)") from error

_MAX_RETRIES = 5  # of a chunk whose worker died
_PATIENCE = 10  # seconds for a host to answer; Ray itself tries for a quarter of an hour


class Cluster:
    """A `Pool` on a Ray cluster; a context manager."""

    num_threads = 1

    def __init__(self, address: str, workers: int):
        """Connects to the cluster at `address`; "local" starts one on this machine, "auto" finds one that runs here.

        Raises:
          InputError: if there is none.
        """
        self._started = not ray.is_initialized()
        if self._started:
            connect(address)
        self.num_workers = workers or max(1, int(ray.cluster_resources().get("CPU", 0)))

    def run(self, chunks: Sequence[Chunk]) -> Iterator[list[Ended]]:
        """Yields the episodes of each chunk when it has ended; Ray runs the chunk of a worker that died again.

        Raises:
          InputError, RunError: what a chunk raised.
          RunError: if a chunk's workers died again and again.
        """
        task = ray.remote(num_cpus=1, max_retries=_MAX_RETRIES)(run_whole_chunk)
        waiting = list(chunks)
        running: list[Any] = []
        while waiting or running:
            while waiting and len(running) < self.num_workers:
                running.append(task.remote(waiting.pop(0)))
            (ended,), running = ray.wait(running, num_returns=1)
            try:
                yield ray.get(ended)
            except ray.exceptions.RayTaskError as error:
                cause = error.cause
                if isinstance(cause, (InputError, RunError)):
                    raise cause from error
                raise RunError(f"a Ray task failed: {_first_line(cause)}") from error
            except ray.exceptions.RayError as error:
                raise RunError(f"a Ray task was lost: {_first_line(error)}; go on with --resume") from error

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *exception: object) -> None:
        if self._started:
            ray.shutdown()


def connect(address: str) -> None:
    """Connects this process to the cluster at `address`, as `Cluster` does.

    Raises:
      InputError: if there is none.
    """
    handler, terminated = signal.getsignal(signal.SIGTERM), False
    try:
        _check_answers(address)
        ray.init(address=address, log_to_driver=False, include_dashboard=False)
    except SystemExit:  # Ray's answer to SIGTERM
        ray.shutdown()
        terminated = True
    except (OSError, ValueError, RuntimeError) as error:
        reason = shortened(str(error), 200)
        raise InputError(f"can't reach a Ray cluster at {address!r}: {reason}") from error
    finally:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGTERM, handler)  # Ray replaces the handler
    if terminated:
        signal.raise_signal(signal.SIGTERM)


def _check_answers(address: str) -> None:
    """Raises `OSError` if nothing answers at an `address` that has a port."""
    parts = urllib.parse.urlsplit(address if "://" in address else f"//{address}")
    if parts.port is not None:
        socket.create_connection((parts.hostname or "", parts.port), _PATIENCE).close()


def _first_line(error: object) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
