"""Compilation of kernels to machine code.

Numba compiles a kernel anew when its file changes, but not when a module that it imports does. So a kernel should call
functions of its own file only.
"""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable
from typing import Any

import numba
from numba.core.event import Listener, register

from mazebench.errors import remark


class _Announcement(Listener):
    """Says once that kernels are compiled, which numba does where its cache lacks them."""

    is_due = multiprocessing.parent_process() is None  # else the workers of an evaluation would all say it

    def on_start(self, event):
        if self.is_due:
            remark("compiling the agent's kernels, which numba's cache lacks; this takes some seconds")
        self.is_due = False

    def on_end(self, event):
        pass


register("numba:compile", _Announcement())


def compiled(function: Callable[..., Any], inline: bool = False, fused: bool = False) -> Callable[..., Any]:
    """Returns `function` as machine code, cached on disk if numba finds a folder that it can write to.

    If `fused`, a product and a sum may become one operation with one rounding: faster, and other last bits.
    """
    options: dict[str, Any] = {
        "error_model": "numpy",
        "forceinline": inline,
        "fastmath": {"contract"} if fused else False,
    }
    try:
        return numba.njit(cache=True, **options)(function)
    except RuntimeError:  # numba found no such folder
        return numba.njit(**options)(function)


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """Returns `function` compiled into its callers, where LLVM might decide otherwise."""
    return compiled(function, inline=True)
