"""Compilation of kernels to machine code.

Numba compiles a kernel anew when its file changes, but not when a module that it imports does. So a kernel should call
functions of its own file only.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba


def compiled(function: Callable[..., Any], inline: bool = False) -> Callable[..., Any]:
    """Returns `function` as machine code, cached on disk if numba finds a folder that it can write to."""
    options: dict[str, Any] = {"error_model": "numpy", "forceinline": inline}
    try:
        return numba.njit(cache=True, **options)(function)
    except RuntimeError:  # numba found no such folder
        return numba.njit(**options)(function)


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """Returns `function` compiled into its callers, where LLVM might decide otherwise."""
    return compiled(function, inline=True)
