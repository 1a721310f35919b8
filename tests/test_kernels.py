"""Compiled kernels: where numba's cache lacks them, one line says why the first answer takes long."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

pytest.importorskip("numba")

from mazebench_agents.common import kernels

CODE = """
import numpy as np
from mazebench_agents.robot.occupancy import posterior

for _ in range(2):
    posterior(np.zeros((5, 5)), np.zeros((5, 5)), np.array([0.5]), 3.0)
"""


def test_a_compilation_is_announced_once_and_cached(tmp_path):
    said = [
        subprocess.run(
            [sys.executable, "-c", CODE],
            env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
            capture_output=True,
            text=True,
        ).stderr
        for _ in range(2)
    ]
    announcement = "compiling the agent's kernels, which numba's cache lacks; this takes some seconds"
    assert [each.count(announcement) for each in said] == [1, 0]


WITH_TURN = """
import sys
from mazebench_agents.robot import body

body.TURN_STEP = float(sys.argv[1])
from mazebench_agents.robot.motion import turned

print(turned(0.0, 1))
"""


def test_a_constant_of_another_module_that_changes_is_compiled_anew(tmp_path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    for turn in ("0.5", "0.25", "0.5"):
        command = [sys.executable, "-c", WITH_TURN, turn]
        assert subprocess.run(command, env=environment, capture_output=True, text=True).stdout.split() == [turn]


@pytest.mark.parametrize(("given", "expected"), [("3", 3), ("2,4", 2), ("", None), ("0", None), ("many", None)])
def test_kernels_run_in_as_many_threads_as_the_environment_says(given, expected, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", given)
    assert kernels.num_threads() == (expected or len(os.sched_getaffinity(0)))
    with kernels.one_thread():
        assert kernels.num_threads() == 1
    assert os.environ["OMP_NUM_THREADS"] == given
