"""MuJoCo's profiler, which environments turn off, each time in a process of its own."""

from __future__ import annotations

import json

import pytest
from processes import run_python

_PROGRAM = """
import hashlib, json, sys
import mujoco
import mazebench

def clock():
    return 7.0

if "own" in sys.argv:
    mujoco.set_mjcb_time(clock)
env = mazebench.make("rebuilt", level=2, seed=0)
env.reset(seed=0)
states = hashlib.sha256()
for step in range(40):
    observation, *_ = env.step(step % 6)
    for value in observation.values():
        states.update(value.tobytes())

other = mujoco.MjData(model := mujoco.MjModel.from_xml_string("<mujoco><worldbody/></mujoco>"))
mujoco.mj_step(model, other)
print(json.dumps({"is_ours": mujoco.get_mjcb_time() not in (None, clock), "is_own": mujoco.get_mjcb_time() is clock,
                  "timed": other.timer[0].duration > 0, "states": states.hexdigest()}))
"""


@pytest.fixture(scope="module")
def stopped() -> dict[str, object]:
    """Returns what the program finds in an ordinary process."""
    return _found()


def test_an_environment_stops_the_profiler_of_the_process(stopped):
    assert (stopped["is_ours"], stopped["timed"]) == (True, False)


def test_a_variable_keeps_the_profiler_and_no_state_differs(stopped):
    kept = _found(MAZEBENCH_TIMERS="1")
    assert (kept["is_ours"], kept["timed"]) == (False, True)
    assert kept["states"] == stopped["states"]


def test_a_clock_that_somebody_has_set_stays():
    assert _found("own")["is_own"]


def _found(*arguments: str, **variables: str) -> dict[str, object]:
    return dict(json.loads(run_python("-c", _PROGRAM, *arguments, variables=variables).stdout))
