"""Imports that users wait for or that would change their process; `lint-imports` checks who imports whom."""

from __future__ import annotations

import json

from processes import run_python


def test_importing_loads_nothing_heavy_and_leaves_the_environment_alone():
    program = """
import os, sys, json
import gymnasium  # which sets a variable of pygame's
before = dict(os.environ)
import mazebench
is_same = dict(os.environ) == before
names = ("mujoco", "dm_control", "torch", "cv2", "scipy", "numba", "matplotlib")
heavy = [name for name in names if name in sys.modules]
import mazebench.cli  # `render` and `bench` choose a backend before MuJoCo reads it
names = ("mujoco", "dm_control", "torch", "numba", "scipy.ndimage", "scipy.sparse")
heavy += [name for name in names if name in sys.modules]
print(json.dumps([is_same, heavy]))
"""
    assert json.loads(run_python("-c", program).stdout) == [True, []]
