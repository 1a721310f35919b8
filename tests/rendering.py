"""Programs that render, in processes of their own."""

from __future__ import annotations

import os
import subprocess
import sys

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


def run_with_egl(program: str) -> None:
    """Runs a program that must succeed and print nothing on standard error; skips where EGL is not usable."""
    environment = os.environ | {"MUJOCO_GL": "egl"}
    result = subprocess.run([sys.executable, "-c", _PROBE + program], env=environment, capture_output=True, text=True)
    if result.returncode == _NO_EGL:
        pytest.skip("EGL is not usable here")
    assert (result.returncode, result.stderr) == (0, "")
