"""Runs chunks as tasks of a Ray cluster."""

from __future__ import annotations

import signal
import socket
import urllib.parse
from collections.abc import Iterator, Sequence
from typing import Any

from mazebench import stopping
from mazebench.errors import InputError, RunError, shortened
from mazebench.evaluation.chunk import PATIENCE, Chunk, Result, run_whole_chunk

try:
    import ray
except ModuleNotFoundError as error:
    raise InputError("--ray needs Ray, which the extra [ray] brings (docs/start.md)") from error

_MAX_RETRIES = 5  # of a chunk whose worker died
_SECONDS_TO_ANSWER = 10  # of a host; Ray itself tries for a quarter of an hour


class Cluster:
    """A `Pool` on a Ray cluster; a context manager."""

    num_threads = 1

    def __init__(self, address: str, workers: int):
        """Connects to the cluster at `address`; "local" starts one on this machine, "auto" finds one that runs here."""
        self._started = not ray.is_initialized()
        if self._started:
            handler, is_terminated = signal.getsignal(signal.SIGTERM), False
            try:
                parts = urllib.parse.urlsplit(address if "://" in address else f"//{address}")
                if parts.port is not None:
                    socket.create_connection((parts.hostname or "", parts.port), _SECONDS_TO_ANSWER).close()
                ray.init(address=address, log_to_driver=False, include_dashboard=False)
            except SystemExit:  # Ray's answer to SIGTERM
                ray.shutdown()
                is_terminated = True
            except (OSError, ValueError, RuntimeError) as error:
                reason = shortened(str(error), 200)
                raise InputError(f"can't reach a Ray cluster at {address!r}: {reason}") from error
            finally:
                if signal.getsignal(signal.SIGTERM) is not handler:
                    signal.signal(signal.SIGTERM, handler)  # Ray replaces the handler
            if is_terminated:
                signal.raise_signal(signal.SIGTERM)
                stopping.check()
        self.num_workers = workers or max(1, int(ray.cluster_resources().get("CPU", 0)))

    def run(self, chunks: Sequence[Chunk]) -> Iterator[list[Result]]:
        """Yields the results of each chunk that has ended; Ray runs the chunk of a worker that died again."""
        task = ray.remote(num_cpus=1, max_retries=_MAX_RETRIES)(run_whole_chunk)
        waiting = list(chunks)
        running: list[Any] = []
        while waiting or running:
            while waiting and len(running) < self.num_workers:
                running.append(task.remote(waiting.pop(0)))
            ended, running = ray.wait(running, num_returns=1, timeout=PATIENCE)
            try:
                found = ray.get(ended)
            except ray.exceptions.RayTaskError as error:
                raise RunError(f"a Ray task failed: {_first_line(error.cause)}") from error
            except ray.exceptions.RayError as error:
                raise RunError(f"a Ray task was lost: {_first_line(error)}; go on with --resume") from error
            for results, fault in found:
                yield results
                if fault is not None:
                    raise fault
            if not found:
                yield []

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *exception: object) -> None:
        if self._started:
            ray.shutdown()


def _first_line(error: object) -> str:
    return (str(error) or type(error).__name__).splitlines()[0]
