"""MuJoCo's profiler, which mazebench turns off: its Python bindings read a clock some 30 times in each `mj_step`.

Without it, a step takes four fifths of the time, and no bit of a state changes. It is a setting of the whole process.
"""

from __future__ import annotations

import functools
import os

import mujoco

from mazebench.kernels import c_callback

_TIMERS = "MAZEBENCH_TIMERS"  # an environment variable; with "1", the profiler stays as it is


@functools.cache
def stop_profiler() -> object:
    """Makes the clock of MuJoCo's profiler a function that returns 0, so that `MjData.timer` reads 0 from now on.

    It does so once a process, and not where somebody has set a clock (`mujoco.set_mjcb_time`) or the environment
    variable `MAZEBENCH_TIMERS` is 1. A clock that is set later stays.

    Returns the function, which must outlive MuJoCo's last step, or None.
    """
    if os.environ.get(_TIMERS) == "1" or mujoco.get_mjcb_time() is not None:
        return None
    clock = c_callback("float64()", _no_time)
    mujoco.set_mjcb_time(clock.ctypes)
    return clock


def _no_time() -> float:
    return 0.0
