"""Programs that tests start in processes of their own."""

from __future__ import annotations

import os
import pathlib
import subprocess
import sys
from collections.abc import Mapping

import pytest

_NO_EGL = 77  # exit status
_PROBE = f"""
import sys
try:
    import mujoco
    mujoco.GLContext(64, 64).free()
except (RuntimeError, ImportError, AttributeError):
    sys.exit({_NO_EGL})
import gymnasium, mazebench, numpy as np
"""


def environment(**variables: str) -> dict[str, str]:
    """Returns this process's environment without the rendering backend that an earlier test chose, with `variables`.

    MuJoCo sets PYOPENGL_PLATFORM where it is imported. With another MUJOCO_GL, a process that inherits it imports
    MuJoCo without rendering and without an error.
    """
    kept = {name: value for name, value in os.environ.items() if name not in ("MUJOCO_GL", "PYOPENGL_PLATFORM")}
    return kept | variables


def run_python(
    *arguments: str | pathlib.Path,
    status: int | None = 0,
    variables: Mapping[str, str] | None = None,
    cwd: pathlib.Path | None = None,
    timeout: float | None = None,
) -> subprocess.CompletedProcess[str]:
    """Runs Python to its end; the test fails with all that it printed unless it ends with `status` (None: any)."""
    result = subprocess.run(
        [sys.executable, *map(str, arguments)],
        env=environment(**(variables or {})),
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=timeout,
    )
    if status is not None and result.returncode != status:
        pytest.fail(f"exit status {result.returncode}, not {status}\n{result.stdout}\n{result.stderr}", pytrace=False)
    return result


def run_with_egl(program: str) -> None:
    """Runs a program that must succeed and print nothing on standard error; skips where EGL is not usable."""
    result = run_python("-c", _PROBE + program, status=None, variables={"MUJOCO_GL": "egl"})
    if result.returncode == _NO_EGL:
        pytest.skip("EGL is not usable here")
    assert (result.returncode, result.stderr) == (0, "")
