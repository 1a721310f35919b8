"""Programs that tests start in processes of their own."""

from __future__ import annotations

import atexit
import functools
import json
import os
import pathlib
import subprocess
import sys
import tempfile
from collections.abc import Mapping

import pytest

_NO_EGL = 77  # exit status
_PROBE = f"""
try:
    mujoco.GLContext(64, 64).free()
except (RuntimeError, AttributeError):
    sys.exit({_NO_EGL})
"""
# Forks a process for each line, a program and where its standard error goes, and prints its exit status. Thus modules
# are imported once.
_FORKS = """
import json, os, sys
try:
    import mujoco
except (RuntimeError, ImportError, AttributeError):
    sys.exit()
import dm_control.mjcf, gymnasium, mazebench.envs.vector, numpy as np
for line in sys.stdin:
    program, errors = json.loads(line)
    if (child := os.fork()) == 0:
        os.dup2(os.open(os.devnull, os.O_RDWR), 1)
        os.dup2(os.open(errors, os.O_WRONLY), 2)
        exec(program)
        break
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
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
    with tempfile.NamedTemporaryFile() as errors:
        forks = _forks()
        print(json.dumps([_PROBE + program, errors.name]), file=forks.stdin, flush=True)
        status = forks.stdout.readline()
        if not status or int(status) == _NO_EGL:
            pytest.skip("EGL is not usable here")
        assert (int(status), errors.read().decode()) == (0, "")


@functools.cache
def _forks() -> subprocess.Popen[str]:
    """The process that forks, with EGL; it ends with this one."""
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    forks = subprocess.Popen([sys.executable, "-c", _FORKS], env=environment(MUJOCO_GL="egl"), **pipes)
    atexit.register(forks.communicate)
    return forks
