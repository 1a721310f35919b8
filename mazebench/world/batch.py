"""Batches of simulations on native threads.

A fork copies a batch without its threads, so a forked process must neither use the batch nor destroy it.
"""

from __future__ import annotations

import ctypes
import os
import weakref

import mujoco
import mujoco.batch

from mazebench.world.profiler import stop_profiler

_batches: weakref.WeakSet[mujoco.batch.Batch] = weakref.WeakSet()


def open_batch(model: mujoco.MjModel, num_sims: int, num_threads: int) -> mujoco.batch.Batch:
    """Returns a batch; its threads end with the last reference to it and to its arrays.

    A process that is forked meanwhile may run to its end, and open batches of its own, but it must not use this one.
    """
    stop_profiler()
    batch = mujoco.batch.Batch(model, num_sims, num_threads)
    _batches.add(batch)
    return batch


def _keep_batches() -> None:
    """Keeps a forked process from destroying the batches of its parent.

    When a batch is destroyed it waits for its threads, which a forked process does not have: it would wait forever.
    The interpreter destroys all objects at its end, also those in global variables, unless a reference to them is
    counted that nobody holds.
    """
    for batch in list(_batches):
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(batch))


os.register_at_fork(after_in_child=_keep_batches)
