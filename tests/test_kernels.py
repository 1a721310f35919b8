"""Compiled kernels and numba's cache of them."""

from __future__ import annotations

import pytest

pytest.importorskip("numba")

from processes import run_python

WITH_TURN = """
import sys
from mazebench_agents.robot import body

body.TURN_STEP = float(sys.argv[1])
from mazebench_agents.robot.motion import turned

print(turned(0.0, 1))
"""


def test_a_constant_of_another_module_that_changes_is_compiled_anew(tmp_path):
    for turn in ("0.5", "0.25", "0.5"):
        assert run_python("-c", WITH_TURN, turn, variables={"NUMBA_CACHE_DIR": str(tmp_path)}).stdout.split() == [turn]
