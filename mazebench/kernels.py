"""Compilation of kernels to machine code, which is kept on disk.

Numba notices when a kernel's file changes, but not when a module does that the kernel uses. So kernels are kept in a
folder that is named after the contents of all files beside kernels, of mazebench and of the kernel's package. Numba
itself would choose folders without that name where it can't write beside kernels.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import multiprocessing
import os
import pathlib
import re
import sys
import tempfile
from collections.abc import Callable, Iterator
from typing import Any

import numba
from numba.core.event import Listener, register
from numba.extending import register_jitable

from mazebench.errors import remark
from mazebench.storage.cache import users_cache

_CONFIG: Any = numba.config
_IMPORT = re.compile(rb"^(from|import) .*\bkernels\b", re.MULTILINE)  # in the files of kernels


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
    """Returns `function` as machine code, cached on disk if there is a folder that can be written to.

    If `fused`, a product and a sum may become one operation with one rounding: faster, and other last bits. If `nogil`,
    several threads may run it at once.
    """
    math = {"contract"} if fused else False
    compile_it: Any = functools.partial(numba.njit, forceinline=inline, nogil=nogil, error_model="numpy", fastmath=math)
    kernel = compile_it(function)
    if (folder := _folder_of(function)) is None:
        return kernel
    with _kept_in(folder), contextlib.suppress(RuntimeError):  # numba found no folder that it can write to
        kernel.enable_caching()
    # Where another user has made a folder below this one, numba chose one of its own.
    return kernel if str(kernel.stats.cache_path).startswith(str(folder)) else compile_it(function)


def c_callback(signature: str, function: Callable[..., Any]) -> Any:
    """Returns `function` as a C function of numba's type `signature`, for libraries that call one; see `compiled`.

    Its attribute `ctypes` is the pointer. It lives as long as the object.
    """
    if (folder := _folder_of(function)) is None:
        return numba.cfunc(signature)(function)
    with _kept_in(folder):
        return numba.cfunc(signature, cache=True)(function)


def _folder_of(function: Callable[..., Any]) -> pathlib.Path | None:
    """Returns the folder for a function's machine code, None if it is not kept."""
    package, file = sys.modules[function.__module__.partition(".")[0]], pathlib.Path(function.__code__.co_filename)
    if _CONFIG.DISABLE_JIT or not hasattr(package, "__path__") or not file.exists():
        return None  # Python, or of a script or an archive, of which nothing says what its kernels use
    return cache_folder(file.parent / "__pycache__", _digest(package.__name__))


@contextlib.contextmanager
def _kept_in(folder: pathlib.Path) -> Iterator[None]:
    """Makes numba keep in a folder the machine code of the functions that it is given meanwhile."""
    given, _CONFIG.CACHE_DIR = _CONFIG.CACHE_DIR, str(folder)
    try:
        yield
    finally:
        _CONFIG.CACHE_DIR = given


@functools.cache
def cache_folder(beside: pathlib.Path, digest: str) -> pathlib.Path | None:
    """Returns a folder that can be written to for machine code of a digest; None if there is none.

    It lies in NUMBA_CACHE_DIR, in `beside`, or in the user's cache.
    """
    # Not what numba read in the working folder's .numba_config.yaml: it unpickles what lies in the folder.
    given = os.environ.get("NUMBA_CACHE_DIR", "")
    for parent in (*([pathlib.Path(given)] if given else []), beside, users_cache()):
        folder = parent / f"kernels-{digest}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
        except OSError:
            continue
        return folder
    if multiprocessing.parent_process() is None:
        remark("found no folder to keep compiled kernels in, so each start compiles them; set NUMBA_CACHE_DIR to one")
    return None


def num_threads() -> int:
    """Returns how many threads kernels may run in: what OMP_NUM_THREADS says, else the cores of this process."""
    given = os.environ.get("OMP_NUM_THREADS", "").partition(",")[0]
    if given.isdecimal() and int(given):
        return int(given)
    return num_cores()


def num_cores() -> int:
    """Returns how many cores this process may use."""
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
def _digest(package: str) -> str:
    """Returns a hash of what the kernels of a package can use: of ours, the files beside kernels; of others, all."""
    ours = pathlib.Path(__file__).parent
    files = {pathlib.Path(__file__), ours / "constants.py"}
    for top in (ours, *map(pathlib.Path, sys.modules[package].__path__)):
        for path in top.rglob("*.py"):
            if top != ours and package != "mazebench_agents":
                files.add(path)
            elif _IMPORT.search(path.read_bytes()):
                files |= set(path.parent.glob("*.py"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in sorted(files))).hexdigest()[:16]
