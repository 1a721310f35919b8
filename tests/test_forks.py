"""Processes that are forked from one with a vector environment, whose simulation runs on native threads."""

from __future__ import annotations

import pathlib

import gymnasium
import numpy as np
import pytest
from processes import run_python

import mazebench
from mazebench.envs.vector import MazeVectorEnv

NUM_ENVS = 8
THREADS = pathlib.Path("/proc/self/task")
pytestmark = pytest.mark.skipif(not THREADS.exists(), reason="no /proc, in which the system lists the threads")


def open_envs() -> MazeVectorEnv:
    """Environments whose threads have run."""
    envs = mazebench.make_vec("local", NUM_ENVS, size=13, num_threads=4)
    envs.reset(seed=0)
    envs.step(np.zeros(NUM_ENVS, dtype=int))
    return envs


def num_threads() -> int:
    return len(list(THREADS.iterdir()))


def test_threads_end_with_close_and_with_the_last_reference():
    before = num_threads()
    envs = open_envs()
    assert num_threads() > before
    envs.close()
    assert num_threads() == before
    envs.close()
    envs = open_envs()
    del envs
    assert num_threads() == before


@pytest.mark.parametrize(
    "use", [lambda envs: envs.reset(), lambda envs: envs.step([0] * NUM_ENVS), lambda envs: envs.render()]
)
def test_a_use_after_close_is_refused(use):
    envs = open_envs()
    envs.close()
    with pytest.raises(gymnasium.error.ClosedEnvironmentError, match=r"found one after close\(\)"):
        use(envs)


# The child refuses its parent's environments, plays its own, collects garbage, and ends as a Python program does.
FORK = """
import gc, os, sys
import gymnasium
from test_forks import open_envs
envs = open_envs()
child = os.fork()
if child == 0:
    try:
        envs.reset()
    except gymnasium.error.ClosedEnvironmentError as error:
        assert str(error).startswith("expected a vector environment that this process made")
        open_envs()
        del envs
        gc.collect()
        sys.exit(7)
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
envs.reset()
"""


def test_a_forked_process_plays_and_ends():
    run_python("-c", FORK, cwd=pathlib.Path(__file__).parent, timeout=120)
