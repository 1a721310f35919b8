"""Processes that are forked from one with a vector environment, whose simulation runs on native threads."""

from __future__ import annotations

import gc
import multiprocessing
import os
import pathlib
import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AsyncVectorEnv

import mazebench
from mazebench.envs.registration import make_env
from mazebench.envs.vector import MazeVectorEnv

NUM_ENVS = 8
THREADS = pathlib.Path("/proc/self/task")
pytestmark = pytest.mark.skipif(not THREADS.exists(), reason="no /proc, in which the system lists the threads")


def open_envs() -> MazeVectorEnv:
    """Environments whose threads have run."""
    envs = mazebench.make_vec("local", NUM_ENVS, size=13, num_threads=4)
    play(envs)
    return envs


def play(envs: MazeVectorEnv, seed: int = 0) -> np.ndarray:
    """Returns the states after two steps."""
    envs.reset(seed=seed)
    envs.step(np.zeros(NUM_ENVS, dtype=int))
    return envs.step(np.zeros(NUM_ENVS, dtype=int))[0]["state"]


def play_anew(seed: int) -> np.ndarray:
    return play(open_envs(), seed)


def num_threads() -> int:
    return len(list(THREADS.iterdir()))


class TestThreads:
    def test_threads_end_with_close(self):
        before = num_threads()
        envs = open_envs()
        assert num_threads() > before
        envs.close()
        assert num_threads() == before
        envs.close()

    def test_threads_end_with_the_last_reference(self):
        gc.disable()
        before = num_threads()
        try:
            envs = open_envs()
            assert num_threads() > before
            del envs
            assert num_threads() == before
        finally:
            gc.enable()

    @pytest.mark.parametrize(
        "use", [lambda envs: envs.reset(), lambda envs: envs.step([0] * NUM_ENVS), lambda envs: envs.render()]
    )
    def test_a_use_after_close_is_refused(self, use):
        envs = open_envs()
        envs.close()
        with pytest.raises(gymnasium.error.ClosedEnvironmentError, match=r"found one after close\(\)"):
            use(envs)


# Each runs in a process of its own, whose child plays, collects garbage, and ends as a Python program does.
BEFORE_FORK = {
    "open": "",
    "closed": "envs.close()",
    "deleted": "del envs",
    "in a circle": "envs.circle = envs; del envs",
    "forgotten after an error": """
try:
    envs.step(None)
except ValueError as error:
    kept = error
del envs""",
}
FORK = """
import gc, os, sys
from test_forks import open_envs, play
envs = open_envs()
{before}
child = os.fork()
if child == 0:
    play(open_envs())
    gc.collect()
    sys.exit(7)
assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
if "envs" in globals() and not envs.closed:
    play(envs)
"""


class TestForks:
    @pytest.mark.parametrize("before", BEFORE_FORK.values(), ids=BEFORE_FORK)
    def test_a_forked_process_plays_and_ends(self, before):
        here = pathlib.Path(__file__).parent
        subprocess.run([sys.executable, "-c", FORK.format(before=before)], cwd=here, check=True, timeout=120)

    def test_a_pool_of_forked_processes_plays_what_this_process_plays(self):
        envs = open_envs()
        with multiprocessing.get_context("fork").Pool(2) as pool:
            states = pool.map(play_anew, [0, 1, 2])
        for seed, found in enumerate(states):
            np.testing.assert_array_equal(found, play(envs, seed))

    def test_gymnasiums_asynchronous_environment_runs_beside_an_open_one(self):
        envs = open_envs()
        with_processes = AsyncVectorEnv([lambda: make_env(size=13)] * 2, context="fork")
        found, _ = with_processes.reset(seed=0)
        with_processes.step(np.zeros(2, dtype=int))
        with_processes.close()
        np.testing.assert_array_equal(found["state"], envs.reset(seed=0)[0]["state"][:2])

    def test_the_environment_of_another_process_is_refused(self):
        envs = open_envs()
        reader, writer = os.pipe()
        child = os.fork()
        if child == 0:
            try:
                envs.step(np.zeros(NUM_ENVS, dtype=int))
            except gymnasium.error.ClosedEnvironmentError as error:
                os.write(writer, str(error).encode())
            envs.close()
            os._exit(0)
        os.close(writer)
        with open(reader, encoding="utf-8") as file:
            assert file.read().startswith("expected a vector environment that this process made")
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
