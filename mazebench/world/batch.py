"""Batches of simulations on native threads, which a forked process must neither use nor wait for."""

from __future__ import annotations

import ctypes
import os
import weakref

import mujoco
import mujoco.batch

_batches: weakref.WeakSet[mujoco.batch.Batch] = weakref.WeakSet()


def open_batch(model: mujoco.MjModel, num_sims: int, num_threads: int) -> mujoco.batch.Batch:
    """Returns a batch; its threads end with the last reference to it and to its arrays.

    A process that is forked meanwhile may run to its end, and open batches of its own, but it must not use this one.
    """
    batch = mujoco.batch.Batch(model, num_sims, num_threads)
    _batches.add(batch)
    return batch


def _keep_batches() -> None:
    """Keeps this process, a forked one, from destroying the batches of its parent.

    A batch waits for its threads when it is destroyed, and a fork copies the batch without the threads. Only a
    reference that nobody gives up outlasts the end of the interpreter, too.
    """
    for batch in list(_batches):
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(batch))


os.register_at_fork(after_in_child=_keep_batches)
