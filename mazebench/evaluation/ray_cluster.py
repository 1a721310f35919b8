"""Ray as an executor, which the extra [ray] brings."""

from __future__ import annotations

import concurrent.futures
import signal
from collections.abc import Callable
from typing import Any

from mazebench.errors import InputError, describe_error

_MAX_RETRIES = 5  # of a task whose node is lost


class RayExecutor(concurrent.futures.Executor):
    """Runs calls as tasks of one core each on a Ray cluster. Ray runs those of a lost node again on another one."""

    def __init__(self, address: str):
        """Connects to a cluster, "ray" for that of this machine, unless this process is connected already.

        Raises:
          InputError: if Ray is not installed, or there is no such cluster.
        """
        try:
            import ray
        except ModuleNotFoundError as error:
            raise InputError("--cluster needs Ray, which the extra [ray] brings (docs/scale.md)") from error
        self._ray, self._connects = ray, not ray.is_initialized()
        if self._connects:
            handler = signal.getsignal(signal.SIGTERM)
            try:
                ray.init("auto" if address == "ray" else address, log_to_driver=False, logging_level="error")
            except Exception as error:  # several kinds, also where the versions of Ray differ
                raise InputError(f"can't reach the cluster {address}: {describe_error(error)}") from error
            finally:
                if signal.getsignal(signal.SIGTERM) is not handler:  # Ray sets its own
                    signal.signal(signal.SIGTERM, handler)
        self.num_cores = int(ray.cluster_resources().get("CPU", 0))

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> concurrent.futures.Future[Any]:
        task = self._ray.remote(num_cpus=1, max_retries=_MAX_RETRIES)(function)
        return task.remote(*args, **kwargs).future()

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Leaves the cluster, which ends the tasks that run."""
        if self._connects:
            self._ray.shutdown()
