"""Compilation of kernels to machine code, which is kept on disk.

Numba notices when a kernel's file changes, but not when a module does that the kernel uses. So kernels are kept in a
folder that is named after the contents of all files beside kernels, of mazebench and of the kernel's package.
"""

from __future__ import annotations

import functools
import hashlib
import multiprocessing
import os
import pathlib
import re
import sys
from collections.abc import Callable
from typing import Any

import numba
from numba.core.event import Listener, register
from numba.extending import register_jitable

_IMPORT = re.compile(rb"^from .*\bkernels\b", re.MULTILINE)  # in the files of kernels


class _Announcement(Listener):
    """Says once that kernels are compiled, which numba does where its cache lacks them."""

    is_due = multiprocessing.parent_process() is None  # else the workers of an evaluation would all say it

    def on_start(self, event: object) -> None:
        if self.is_due:
            print("mazebench: compiling kernels, which numba's cache lacks; this takes some seconds", file=sys.stderr)
        self.is_due = False

    def on_end(self, event: object) -> None:
        pass


register("numba:compile", _Announcement())  # type: ignore[no-untyped-call]


def compiled(
    function: Callable[..., Any], inline: bool = False, fused: bool = False, nogil: bool = False
) -> Callable[..., Any]:
    """Returns `function` as machine code, cached on disk if numba finds a folder that it can write to.

    If `fused`, a product and a sum may become one operation with one rounding: faster, and other last bits. If `nogil`,
    several threads may run it at once.
    """
    math = {"contract"} if fused else False
    compile_it = functools.partial(numba.njit, forceinline=inline, nogil=nogil, error_model="numpy", fastmath=math)
    package = sys.modules[function.__module__.partition(".")[0]]
    if not hasattr(package, "__path__"):  # of a script, of which nothing says what its kernels use
        return compile_it(function)
    config: Any = numba.config
    given = config.CACHE_DIR
    parent = pathlib.Path(given) if given else pathlib.Path(function.__code__.co_filename).parent / "__pycache__"
    config.CACHE_DIR = str(parent / f"kernels-{_digest(*package.__path__)}")
    try:
        return compile_it(function, cache=True)
    except RuntimeError:  # numba found no folder that it can write to
        return compile_it(function)
    finally:
        config.CACHE_DIR = given


def num_threads() -> int:
    """Returns how many threads kernels may run in: what OMP_NUM_THREADS says, else the cores of this process."""
    given = os.environ.get("OMP_NUM_THREADS", "").partition(",")[0]
    if given.isdecimal() and int(given):
        return int(given)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """Returns `function` compiled into its callers, where LLVM might decide otherwise."""
    return compiled(function, inline=True)


def compiled_by_callers(function: Callable[..., Any]) -> Callable[..., Any]:
    """Returns `function` as it is, for Python; kernels that call it compile it into themselves.

    It is inlined, because numba does not keep kernels that give functions to other kernels.
    """
    return register_jitable(inline="always")(function)


@functools.cache
def _digest(*package: str) -> str:
    """Returns a hash of what the kernels of a package, whose folders are given, can use: all files beside kernels."""
    ours = pathlib.Path(__file__).parent
    files = {pathlib.Path(__file__), ours / "constants.py"}
    for top in (ours, *map(pathlib.Path, package)):
        for path in top.rglob("*.py"):
            if _IMPORT.search(path.read_bytes()):
                files |= set(path.parent.glob("*.py"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in sorted(files))).hexdigest()[:16]
